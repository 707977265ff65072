"""The dependency rules: one direction, no circles, two programs that share only the contract.

Each rule has a twin that feeds it a bad sample, so that a rule which can no longer fail is seen.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from import_graph import find_circle, import_graph, imported_names, read_trees

ROOT = Path(__file__).parents[1]
# Lowest first. A module may import its own row and the rows above it on this list.
LAYERS = (
    ("contract", "config"),
    ("geometry",),
    ("state",),
    ("field",),
    ("rendering",),
    ("perception", "action"),
    ("networks",),
    ("frame_renderer",),
    ("checkpoint", "dataset", "images"),
    ("kept_frames", "fair_threads", "render_options", "object_layers"),
    ("admission", "environment"),
    ("shots", "mesh"),
    ("training", "evaluation", "interop", "footage", "recording", "curation", "cluster", "vgg"),
    ("benchmark", "worker", "demo", "play", "packing"),
    ("cli",),
)
HEAVY = {"torch", "bpy", "cv2", "scipy", "trimesh", "OpenImageIO", "rich", "typer", "matplotlib"}


def layer_breaches(root):
    """Imports of `pe_runtime` that point upwards, and modules without a place in LAYERS."""
    rank = {name: height for height, names in enumerate(LAYERS) for name in names}
    graph = import_graph(read_trees(root, "pe_runtime"))
    # The package's own __init__ only loads public names lazily, from wherever they live.
    graph.pop("pe_runtime", None)
    for module, targets in graph.items():
        if room(module) not in rank:
            yield f"{module} has no place in LAYERS"
            continue
        for target in sorted(targets - {"pe_runtime"}):
            if rank.get(room(target), -1) > rank[room(module)]:
                yield f"{module} imports {target}, which stands above it"


def room(module):
    return module.split(".")[1]


def foreign_imports(root, package, allowed):
    """Imports in `package` for which `allowed(name)` is false."""
    for module, (tree, is_package) in read_trees(root, package).items():
        for name in imported_names(tree, module, is_package):
            if not allowed(name):
                yield f"{module} imports {name}"


def is_within(name, *packages):
    return any(name == package or name.startswith(package + ".") for package in packages)


def fits_the_runtime(name):
    return not is_within(name, "bpy", "mathutils", "blender_addon")


def fits_the_addon(name):
    if is_within(name, "pe_runtime"):
        bare = name in ("pe_runtime", "pe_runtime.__version__")  # where it lies, which one it is
        return bare or is_within(name, "pe_runtime.contract")
    return not is_within(name, "torch", "safetensors", "jaxtyping", "scipy", "cv2", "trimesh")


def modules_after(statement, root=ROOT):
    """Names of `sys.modules` that a statement adds in a fresh interpreter."""
    program = (
        "import json, sys; before = set(sys.modules)\n"
        f"{statement}\n"
        "print(json.dumps(sorted(set(sys.modules) - before)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=root, capture_output=True, text=True, check=True
    )
    return {name.split(".")[0] for name in json.loads(done.stdout)}


def write_package(root, files):
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def test_imports_in_the_runtime_point_one_way():
    assert list(layer_breaches(ROOT)) == []


@pytest.mark.parametrize(
    "statement",
    [
        "import pe_runtime.environment",
        "from pe_runtime import environment",
        "from pe_runtime.environment import PlayableEnvironment",
        "from .. import environment",
        "def late():\n    from ..environment import PlayableEnvironment",
    ],
)
def test_the_layer_rule_sees_an_upward_import(tmp_path, statement):
    write_package(
        tmp_path,
        {
            "pe_runtime/__init__.py": "",
            "pe_runtime/environment.py": "",
            "pe_runtime/field/layers.py": statement,
        },
    )
    assert list(layer_breaches(tmp_path)) == [
        "pe_runtime.field.layers imports pe_runtime.environment, which stands above it"
    ]


def test_the_layer_rule_sees_a_module_without_a_place(tmp_path):
    write_package(tmp_path, {"pe_runtime/miscellany.py": ""})
    assert list(layer_breaches(tmp_path)) == ["pe_runtime.miscellany has no place in LAYERS"]


def test_no_import_circles_in_either_program():
    for package in ("pe_runtime", "blender_addon"):
        graph = import_graph(read_trees(ROOT, package))
        assert graph, package
        assert find_circle(graph) is None


def test_the_circle_rule_sees_a_circle_inside_one_layer(tmp_path):
    write_package(
        tmp_path,
        {
            "pe_runtime/field/a.py": "from .b import thing",
            "pe_runtime/field/b.py": "from pe_runtime.field import c",
            "pe_runtime/field/c.py": "import pe_runtime.field.a",
        },
    )
    circle = find_circle(import_graph(read_trees(tmp_path, "pe_runtime")))
    assert circle == [f"pe_runtime.field.{name}" for name in "abca"]


def test_the_runtime_never_imports_blender_or_the_addon():
    assert list(foreign_imports(ROOT, "pe_runtime", fits_the_runtime)) == []


def test_the_addon_imports_only_the_contract_and_never_torch():
    assert read_trees(ROOT, "blender_addon")
    assert list(foreign_imports(ROOT, "blender_addon", fits_the_addon)) == []


def test_the_foreign_import_rule_sees_what_is_forbidden(tmp_path):
    write_package(
        tmp_path,
        {
            "pe_runtime/a.py": "import bpy.types\nfrom blender_addon import session",
            "blender_addon/a.py": "def f():\n    import torch\nfrom pe_runtime import state",
            "blender_addon/b.py": "from pe_runtime.contract.camera import Camera\nimport bpy",
        },
    )
    assert list(foreign_imports(tmp_path, "pe_runtime", fits_the_runtime)) == [
        "pe_runtime.a imports bpy.types",
        "pe_runtime.a imports blender_addon.session",
    ]
    assert set(foreign_imports(tmp_path, "blender_addon", fits_the_addon)) == {
        "blender_addon.a imports torch",
        "blender_addon.a imports pe_runtime.state",
    }


def test_importing_the_package_loads_nothing_heavy():
    assert not modules_after("import pe_runtime") & HEAVY


def test_the_contract_needs_only_the_standard_library_and_numpy():
    names = [f"pe_runtime.contract.{p.stem}" for p in (ROOT / "pe_runtime/contract").glob("*.py")]
    loaded = modules_after("import numpy, pe_runtime.contract, " + ", ".join(sorted(names)))
    numpys_own = modules_after("import numpy")
    assert loaded - numpys_own - set(sys.stdlib_module_names) == {"pe_runtime"}


def test_the_fresh_interpreter_rule_sees_a_heavy_import(tmp_path):
    write_package(tmp_path, {"pe_sample/__init__.py": "import rich.text"})
    assert modules_after("import pe_sample", tmp_path) & HEAVY == {"rich"}


def test_every_public_name_of_the_package_loads():
    import pe_runtime

    assert set(pe_runtime.__all__) <= set(dir(pe_runtime))
    for name in pe_runtime.__all__:
        assert getattr(pe_runtime, name).__name__ == name


def test_an_unknown_public_name_is_an_attribute_error():
    import pe_runtime

    with pytest.raises(AttributeError, match="no attribute 'Playground'"):
        pe_runtime.Playground  # noqa: B018 -- the access is the test
