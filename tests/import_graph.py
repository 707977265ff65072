"""Who imports whom, read from source alone: nothing is imported or run."""

import ast
from pathlib import Path


def module_name(path, root):
    """`root/pe_runtime/field/layers.py` -> `pe_runtime.field.layers`."""
    parts = list(path.relative_to(root).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def read_trees(root, package):
    """Parse each file of a package: {module name: (tree, is it a package's `__init__`)}."""
    paths = sorted((Path(root) / package).rglob("*.py"))
    return {
        module_name(path, root): (ast.parse(path.read_text()), path.name == "__init__.py")
        for path in paths
    }


def imported_names(tree, module, is_package):
    """Every dotted name an import statement anywhere in the file could mean."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        if isinstance(node, ast.ImportFrom):
            base = _absolute(node, module, is_package)
            yield from (f"{base}.{alias.name}" for alias in node.names)


def _absolute(node, module, is_package):
    if not node.level:
        return node.module
    parents = module.split(".")
    keep = len(parents) - node.level + is_package
    return ".".join([*parents[:keep], *([node.module] if node.module else [])])


def import_graph(trees):
    """Edges between the modules of one package: {module: set of modules it imports}."""
    return {
        module: {
            target
            for name in imported_names(tree, module, is_package)
            if (target := _longest_module(name, trees)) and target != module
        }
        for module, (tree, is_package) in trees.items()
    }


def _longest_module(name, trees):
    """The module that a dotted name lives in: `a.b.Thing` -> `a.b`."""
    parts = name.split(".")
    candidates = (".".join(parts[:end]) for end in range(len(parts), 0, -1))
    return next((candidate for candidate in candidates if candidate in trees), None)


def find_circle(graph):
    """One import circle as a list of modules, or None."""
    done = set()

    def visit(module, path):
        if module in path:
            return [*path[path.index(module) :], module]
        if module in done:
            return None
        circles = (visit(target, [*path, module]) for target in sorted(graph[module]))
        circle = next(filter(None, circles), None)
        done.add(module)
        return circle

    return next(filter(None, (visit(module, []) for module in sorted(graph))), None)
