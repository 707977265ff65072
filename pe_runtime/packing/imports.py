"""Which imports of an extension nothing in it answers, read from source alone."""

import ast
import sys
from collections.abc import Iterator, Mapping

from pe_runtime.packing.archives import Contents

ADDON = "addon"
"""Stands for whatever Blender calls the add-on's package."""
BLENDERS = frozenset(
    "addon_utils aud bl_math bl_operators bl_ui blf bmesh bpy bpy_extras freestyle gpu "
    "gpu_extras idprop imbuf mathutils nodeitems_utils numpy rna_prop_ui".split()
)
"""What every Blender brings."""


def missing_imports(files: Contents, brought: Contents) -> Iterator[str]:
    """Lines that would raise an ImportError in a Blender without anything else.

    Args:
        files: Files of the add-on, by their path in it.
        brought: Files of its wheels, by their path in Blender's site-packages.
    """
    try:
        addon, wheels = _trees(files, f"{ADDON}/"), _trees(brought)
    except SyntaxError as error:
        yield f"{error.filename}:{error.lineno} is no Python: {error.msg}"
        return
    reachable = {**addon, **wheels}
    bound = {module: _bound_names(tree) for module, tree in reachable.items()}
    packages = _packages(files, f"{ADDON}/") | _packages(brought)
    for module, tree in reachable.items():
        package = module if module in packages else module.rpartition(".")[0]
        for line, base, name in _imported(tree, package):
            if not _is_there(base, name, bound):
                wanted = f"{base}.{name}" if name else base
                yield f"{module}:{line} imports {wanted}, which the extension does not bring"


def _trees(files: Contents, root: str = "") -> dict[str, ast.Module]:
    """Parsed modules by dotted name."""
    sources = {name: data for name, data in files.items() if name.endswith(".py")}
    return {_dotted(root + name): ast.parse(data, name) for name, data in sources.items()}


def _dotted(path: str) -> str:
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def _packages(files: Contents, root: str = "") -> set[str]:
    """Dotted names of the packages among these files."""
    return {_dotted(root + name) for name in files if name.split("/")[-1] == "__init__.py"}


def _bound_names(tree: ast.Module) -> set[str]:
    """Names that importing the module may give it."""
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            names.add(node.name)
        elif isinstance(node, ast.alias):
            names.add((node.asname or node.name).split(".")[0])
    return names


def _imported(tree: ast.Module, package: str) -> Iterator[tuple[int, str, str]]:
    """Line, module and name of every import; the name is empty for `import module`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parents = package.split(".")
            above = parents[: len(parents) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            yield from ((node.lineno, base, alias.name) for alias in node.names)


def _is_there(base: str, name: str, bound: Mapping[str, set[str]]) -> bool:
    top = base.split(".")[0]
    if top in BLENDERS or top in sys.stdlib_module_names:
        return True
    if f"{base}.{name}" in bound:
        return True
    return base in bound and (not name or name in bound[base])
