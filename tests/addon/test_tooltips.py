"""Everything that can be pressed or set says what it is for, and when grey, why."""

import ast

import pytest

bpy = pytest.importorskip("bpy")
pytestmark = pytest.mark.blender

from addon.visible_strings import (  # noqa: E402
    ROOT,
    WITHOUT_WINDOW,
    operators,
    own_classes,
    shown_properties,
)


def bad(name, description):
    """Whether a tooltip says nothing, or ends as Blender ends it anyway."""
    says_nothing = not description or description.lower() == name.lower()
    return says_nothing or description != description.strip() or description.endswith(".")


def functions():
    """All functions of the add-on by name; of one name, all."""
    found = {}
    for path in sorted(ROOT.rglob("*.py")):
        if not set(WITHOUT_WINDOW) & set(path.relative_to(ROOT).parts):
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.FunctionDef):
                    found.setdefault(node.name, []).append(node)
    return found


def silent_refusals(function, known):
    """Lines where a poll may say no without a word.

    Args:
        function: The poll's syntax.
        known: Other functions by name, which may speak for it.
    """

    def speaks(node):
        if isinstance(node, ast.BoolOp) and isinstance(node.op, ast.And):
            return all(map(speaks, node.values))
        if not isinstance(node, ast.Call):
            return False
        if ast.unparse(node.func) == "super().poll":
            return True  # which is looked at where it stands
        name = getattr(node.func, "id", "")
        others = [each for each in known.get(name, ()) if name != function.name]
        return name == "allowed" or (
            bool(others) and not any(silent_refusals(each, known) for each in others)
        )

    spoken = {
        id(inner)
        for node in ast.walk(function)
        if isinstance(node, ast.If)
        and isinstance(node.test, ast.UnaryOp)
        and isinstance(node.test.op, ast.Not)
        and speaks(node.test.operand)
        for inner in node.body
    }
    return [
        node.lineno
        for node in ast.walk(function)
        if isinstance(node, ast.Return)
        and id(node) not in spoken
        and not speaks(node.value)
        and getattr(node.value, "value", None) is not True
    ]


def test_every_operator_has_a_tooltip(addon):
    assert [each.__name__ for each, rna in operators() if bad(each.bl_label, rna.description)] == []


def test_every_property_has_a_name_and_a_tooltip(addon):
    wrong = [
        f"{owner}.{prop.identifier}"
        for owner, prop in shown_properties()
        if bad(prop.name, prop.description) or prop.name == prop.identifier
    ]
    assert wrong == []


def test_every_choice_has_a_tooltip(addon):
    wrong = [
        f"{owner}.{prop.identifier}.{item.identifier}"
        for owner, prop in shown_properties()
        if prop.type == "ENUM"
        for item in prop.enum_items_static
        if bad(item.name, item.description)
    ]
    assert wrong == []


def test_every_panel_has_a_label_and_says_what_it_is_for(addon):
    panels = list(own_classes(bpy.types.Panel))
    assert panels
    assert [each.__name__ for each in panels if not (each.bl_label and each.__doc__)] == []


def test_no_poll_refuses_without_a_word():
    known = functions()
    wrong = []
    for path in sorted(ROOT.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            # Panels come and go; only buttons are greyed.
            if isinstance(node, ast.ClassDef) and "_PT_" not in node.name:
                polls = [each for each in node.body if getattr(each, "name", "") == "poll"]
                wrong += [
                    f"{path.name}:{line} {node.name}"
                    for each in polls
                    for line in silent_refusals(each, known)
                ]
    assert wrong == []


def test_in_an_empty_file_whatever_is_grey_says_why(addon):
    greyed = {}
    for each, _ in operators():
        name = each.bl_idname.partition("_OT_")[2] or each.bl_idname.partition(".")[2]
        operator = getattr(bpy.ops.playable, name)
        if not operator.poll():
            with pytest.raises(RuntimeError) as refused:
                operator()
            greyed[name] = str(refused.value).partition(".poll()")[2].strip()
    assert len(greyed) > 10
    assert [name for name, why in greyed.items() if not why or "context is incorrect" in why] == []
    assert greyed["bake_paths"] == "Make a New Playable Environment first"


@pytest.mark.parametrize(
    ("body", "lines"),
    [
        ("return allowed(cls, x, 'why')", []),
        ("return True", []),
        ("return x is not None", [2]),
        ("return x and allowed(cls, x, 'why')", [2]),
        ("if not allowed(cls, x, 'why'):\n        return False\n    return True", []),
        ("if not x:\n        return False\n    return allowed(cls, x, 'why')", [3]),
        ("if not super().poll(x):\n        return False\n    return True", []),
        ("return chosen(cls, x)", []),
        ("return chosen(cls, x) and allowed(cls, x, 'why')", []),
        ("return chosen(cls, x) and x", [2]),
        ("return shrugging(cls, x)", [2]),
    ],
)
def test_the_check_of_polls_sees_silence(body, lines):
    helping = (
        "def chosen(c, x):\n    return allowed(c, x, 'why')\ndef shrugging(c, x):\n    return x"
    )
    known = {each.name: [each] for each in ast.parse(helping).body}
    poll = ast.parse(f"def poll(cls, x):\n    {body}").body[0]
    assert silent_refusals(poll, known) == lines
