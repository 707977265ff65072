"""The house budgets and bans that the linter does not know, each with a sample that breaks it."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("pe_runtime", "blender_addon")
FILE_LINES, BODY_LINES, PARAMETERS, NESTING = 400, 60, 7, 4
BANNED_NAMES = "utils helpers common misc manager handler wrapper base v2 new final".split()
BANNED_IMPORTS = {"pickle", "cPickle", "dill", "importlib", "imp"}
BANNED_CALLS = {"eval", "exec"}
BANNED_METHODS = {"cuda", "import_module"}
DOORS = {"cli", "worker"}
HOMES = {
    "safetensors": ("weights on disk", ("checkpoint",)),
    "OpenImageIO": ("pixels on disk", ("images", "datagen")),
    "struct": ("the wire", ("messages",)),
    "sys.stdout": ("what is printed", ("cli", "worker", "__main__")),
    "bpy.context": ("the user's context", ("operators", "panels", "preferences", "datagen")),
}
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)


def sources(*packages):
    return [path for package in packages for path in sorted((ROOT / package).rglob("*.py"))]


def breaches(check, *packages):
    """`file:line what` for everything a check finds in the packages' files."""
    found = []
    for path in sources(*packages):
        tree = ast.parse(path.read_text())
        found += [f"{path.relative_to(ROOT)}:{line} {what}" for line, what in check(path, tree)]
    return found


def budget_breaches(path, tree):
    """Functions too long, with too many parameters, or nested too deeply."""
    for node in ast.walk(tree):
        if not isinstance(node, FUNCTIONS):
            continue
        arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
        named = [a for a in arguments if a.arg not in ("self", "cls")]
        if body_lines(node) > BODY_LINES:
            yield node.lineno, f"{node.name}: {body_lines(node)} lines"
        if len(named) > PARAMETERS:
            yield node.lineno, f"{node.name}: {len(named)} parameters"
        if depth(node.body) > NESTING:
            yield node.lineno, f"{node.name}: nested {depth(node.body)} deep"


def body_lines(function):
    first = function.body[0]
    documented = ast.get_docstring(function) is not None
    doc = first.end_lineno - first.lineno + 1 if documented else 0
    return function.end_lineno - function.lineno + 1 - doc


def depth(body):
    """How many blocks deep statements stand; an `elif` is as deep as its `if`."""
    deepest = 0
    for node in body:
        if isinstance(node, (*FUNCTIONS, ast.ClassDef)):
            continue
        for name in ("body", "orelse", "finalbody"):
            block = getattr(node, name, None) or []
            chained = name == "orelse" and [type(n) for n in block] == [ast.If]
            if block:
                deepest = max(deepest, depth(block) + (not chained))
    return deepest


def name_breaches(path, tree):
    """Files and classes whose name ends in a word that says nothing."""
    if path.stem.split("_")[-1] in BANNED_NAMES:
        yield 1, path.name
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef) and last_word(node.name) in BANNED_NAMES:
            yield node.lineno, node.name


def last_word(class_name):
    """`FrameManager` -> `manager`, `ModelV2` -> `v2`, `Database` -> `database`."""
    return re.findall(r"[A-Z]+[a-z0-9]*|[a-z0-9]+", class_name)[-1].lower()


def danger_breaches(path, tree):
    """Code that could run what a file says, or that binds a network to one device."""
    for node in ast.walk(tree):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        for name in names:
            if name.split(".")[0] in BANNED_IMPORTS:
                yield node.lineno, f"imports {name}"
        if isinstance(node, ast.Call):
            if getattr(node.func, "id", None) in BANNED_CALLS:
                yield node.lineno, f"calls {node.func.id}"
            if getattr(node.func, "attr", None) in BANNED_METHODS:
                yield node.lineno, f"calls .{node.func.attr}"
            if any(k.arg == "allow_pickle" and truthy(k.value) for k in node.keywords):
                yield node.lineno, "allows pickles"


def truthy(node):
    return not (isinstance(node, ast.Constant) and not node.value)


def print_breaches(path, tree):
    """`print` outside the doors: the worker's stdout is a wire."""
    if DOORS & {*path.parts, path.stem}:
        return
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "id", None) == "print":
            yield node.lineno, "prints"


def home_breaches(path, tree):
    """Knowledge that has one home, met elsewhere (see HOMES)."""
    used = {dotted(node) for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    for node in ast.walk(tree):
        used |= {alias.name for alias in node.names} if isinstance(node, ast.Import) else set()
        used |= {node.module} if isinstance(node, ast.ImportFrom) else set()
    for name, (what, homes) in HOMES.items():
        at_home = path.stem in homes or set(homes) & set(path.parts)
        if not at_home and any(u == name or str(u).startswith(name + ".") for u in used):
            yield 1, f"uses {name}: {what} lives in {', '.join(homes)}"


def dotted(node):
    """`sys.stdout.write` of an attribute chain; "" if it starts with something else."""
    if isinstance(node, ast.Name):
        return node.id
    inner = dotted(node.value) if isinstance(node, ast.Attribute) else ""
    return f"{inner}.{node.attr}" if inner else ""


def missing_documentation(path, tree):
    if path.stat().st_size and not ast.get_docstring(tree):
        yield 1, "has no docstring that says what the file is for"


def test_no_file_is_longer_than_four_hundred_lines():
    long = [p for p in sources(*PACKAGES, "tests") if len(p.read_text().splitlines()) > FILE_LINES]
    assert long == []


def test_functions_keep_the_budgets_of_length_parameters_and_nesting():
    assert breaches(budget_breaches, *PACKAGES, "tests") == []


def test_no_file_or_class_has_a_name_that_says_nothing():
    assert breaches(name_breaches, *PACKAGES, "tests") == []


def test_nothing_is_unpickled_evaluated_or_imported_by_string_outside_interop():
    found = breaches(danger_breaches, *PACKAGES)
    assert [b for b in found if not b.startswith("pe_runtime/interop/")] == []


def test_only_the_doors_print():
    assert breaches(print_breaches, *PACKAGES) == []


def test_each_piece_of_knowledge_has_one_home():
    assert breaches(home_breaches, *PACKAGES) == []


def test_every_file_says_what_it_is_for():
    assert breaches(missing_documentation, *PACKAGES) == []


HOME_OF_WEIGHTS = "uses safetensors: weights on disk lives in checkpoint"
HOME_OF_CONTEXT = (
    "uses bpy.context: the user's context lives in operators, panels, preferences, datagen"
)
BAD_SAMPLES = [
    (budget_breaches, "def f(a, b, c, d, e, f, g, h): pass", "f: 8 parameters"),
    (budget_breaches, "def f():\n" + "    x = 1\n" * 60, "f: 61 lines"),
    (
        budget_breaches,
        "def f():\n" + "".join("    " * n + "if x:\n" for n in range(1, 6)) + "    " * 6 + "y",
        "f: nested 5 deep",
    ),
    (name_breaches, "class FrameManager: pass", "FrameManager"),
    (name_breaches, "class ModelV2: pass", "ModelV2"),
    (danger_breaches, "import pickle", "imports pickle"),
    (danger_breaches, "from importlib import import_module", "imports importlib"),
    (danger_breaches, "eval('1')", "calls eval"),
    (danger_breaches, "model.cuda()", "calls .cuda"),
    (danger_breaches, "np.load(path, allow_pickle=True)", "allows pickles"),
    (danger_breaches, "np.load(path, allow_pickle=ask)", "allows pickles"),
    (home_breaches, "import safetensors.torch", HOME_OF_WEIGHTS),
    (home_breaches, "from safetensors import safe_open", HOME_OF_WEIGHTS),
    (home_breaches, "scene = bpy.context.scene", HOME_OF_CONTEXT),
    (print_breaches, "def f():\n    print(1)", "prints"),
]


@pytest.mark.parametrize(("check", "source", "what"), BAD_SAMPLES)
def test_each_rule_sees_its_breach(check, source, what):
    assert [w for _, w in check(Path("sample.py"), ast.parse(source))] == [what]


def test_the_name_rule_sees_a_file_of_odds_and_ends():
    found = list(name_breaches(Path("mesh_utils.py"), ast.parse("")))
    assert found == [(1, "mesh_utils.py")]


def test_the_rules_let_good_code_pass():
    good = (
        "class Database:\n    def f(self, a, b, c, d, e, f, g):\n"
        "        return np.load(a, allow_pickle=False)"
    )
    for check in (budget_breaches, name_breaches, danger_breaches, home_breaches, print_breaches):
        assert list(check(Path("sample.py"), ast.parse(good))) == []


def test_the_rules_read_the_real_files():
    assert len(sources(*PACKAGES)) > 20
