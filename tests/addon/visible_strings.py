"""Every English string that the add-on can show, with the context in which Blender looks it up.

Classes tell theirs once they are registered. Of the sources count what is given to the interface
by a call that shows words, and any other literal that begins like a sentence: such words reach a
panel through functions and constants.
"""

import ast
import re
import sys
from pathlib import Path

import bpy

import blender_addon

ROOT = Path(blender_addon.__file__).parent
WITHOUT_WINDOW = ("datagen", "examples", "translations")
ANYWHERE, OPERATOR = "*", "Operator"
SHOWN_KEYWORDS = {"text", "heading", "title", "message", "confirm_text"}
OPERATOR_CALLS = {"operator", "operator_menu_enum", "operator_enum"}
LOOKED_UP = {"iface_", "tip_", "translate"}
STAGES = {"on_progress", "on_stage", "Progress"}
SENTENCE = re.compile(r"(\d +)?[A-Z]")
IDENTIFIER = re.compile(r"[A-Z0-9]+_|[A-Z][a-z]+([A-Z][a-z]+)+$")
NOT_SHOWN = {
    # Modes, editors and keymaps by their English names.
    "Object Mode", "Object Non-modal", "Dopesheet", "Graph Editor", "Frame Change",
    # Colour spaces, view transforms, passes and their beginnings.
    "Linear Rec.709", "Standard", "None", "Combined", "Depth", "Background", "Layer ", "Mask ",
    # Data-blocks, which everybody may rename.
    "Camera", "Environment Camera", "Layer", "Point", "Playable Environment sampling",
    "Playable Environment clip",
    # Parts of sentences with values in them, which stay English.
    "View Transform", "Look", "Exposure", "Gamma", "Use Curves", "White Balance is on",
    # Programs and their words.
    "Installing collected packages: ", "Requires-Dist: torch==", "Lib/site-packages", "Scripts",
}  # fmt: skip
"""Literals that only look like something that is shown."""


def own_classes(*kinds):
    """The add-on's classes of some of Blender's kinds."""
    for kind in kinds:
        for each in kind.__subclasses__():
            if each.__module__.startswith("blender_addon"):
                yield each
            yield from own_classes(each)


def operators():
    """The add-on's operators as Blender knows them: type and RNA."""
    for each in own_classes(bpy.types.Operator):
        name = each.bl_idname.partition("_OT_")[2] or each.bl_idname.partition(".")[2]
        yield each, getattr(bpy.ops.playable, name).get_rna_type()


def shown_properties():
    """Owner's name and property, for all that somebody may see a name or a tooltip of."""
    for each, rna in operators():
        yield from _shown(each.__name__, rna)
    for each in own_classes(bpy.types.PropertyGroup, bpy.types.AddonPreferences):
        yield from _shown(each.__name__, each.bl_rna)


def _shown(owner, rna):
    inherited = set(bpy.types.PropertyGroup.bl_rna.properties.keys())
    inherited |= set(bpy.types.AddonPreferences.bl_rna.properties.keys())
    for prop in rna.properties:
        is_group = prop.type == "COLLECTION" or (
            prop.type == "POINTER" and issubclass(type(prop.fixed_type), bpy.types.PropertyGroup)
        )
        if not prop.is_hidden and prop.identifier not in inherited and not is_group:
            yield owner, prop


def visible_strings():
    """(context, string) of all that is shown and has words in it."""
    found = {*_strings_of_classes()}
    told = {said for _, said in found}
    for tree, names in _sources():
        given, others = strings_of_source(tree, names)
        found |= given | {(ANYWHERE, said) for said in others - told}
    return {(context, said) for context, said in found if any(map(str.islower, said))}


def _strings_of_classes():
    for each, rna in operators():
        yield OPERATOR, each.bl_label
        yield ANYWHERE, rna.description
    for each in own_classes(bpy.types.Panel, bpy.types.RenderEngine):
        yield getattr(each, "bl_translation_context", ANYWHERE), each.bl_label
        yield ANYWHERE, getattr(each, "bl_category", "")
    for _, prop in shown_properties():
        yield prop.translation_context, prop.name
        yield ANYWHERE, prop.description
        for item in prop.enum_items_static if prop.type == "ENUM" else ():
            yield prop.translation_context, item.name
            yield ANYWHERE, item.description


def _sources():
    for path in sorted(ROOT.rglob("*.py")):
        place = path.relative_to(ROOT)
        if not set(WITHOUT_WINDOW) & set(place.parts):
            name = ".".join((blender_addon.__name__, *place.with_suffix("").parts))
            module = sys.modules.get(name.removesuffix(".__init__"))
            yield ast.parse(path.read_text()), vars(module) if module else {}


def strings_of_source(tree, names):
    """What one file gives to the interface, (context, string), and its other sentences.

    Args:
        tree: Its syntax.
        names: The module's own names, for constants.
    """
    seen, given, others = set(_never_shown(tree)), set(), set()
    for call in (node for node in ast.walk(tree) if isinstance(node, ast.Call)):
        if getattr(_keywords(call).get("translate"), "value", True) is False:
            seen |= {*_ways(_keywords(call).get("text"))}
            continue
        for context, expression in _shown_by(call):
            for node in _ways(expression):
                seen.add(node)
                word = names.get(node.id) if isinstance(node, ast.Name) else node.value
                if isinstance(word, str):
                    given.add((context, word))
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in seen:
            word = node.value
            if SENTENCE.match(word) and not IDENTIFIER.match(word) and word not in NOT_SHOWN:
                others.add(word)
    return given, others


def _shown_by(call):
    """(context, expression) of the words that a call shows."""
    name = _name(call)
    for key in SHOWN_KEYWORDS & set(_keywords(call)):
        yield OPERATOR if name in OPERATOR_CALLS else ANYWHERE, _keywords(call)[key]
    if name in LOOKED_UP and call.args:
        yield call.args[1].value if len(call.args) > 1 else ANYWHERE, call.args[0]
    if name == "allowed" and len(call.args) > 2:
        yield ANYWHERE, call.args[2]
    if name == "poll_message_set" or name in STAGES and call.args:
        yield ANYWHERE, call.args[0]


def _keywords(call):
    return {each.arg: each.value for each in call.keywords}


def _ways(expression):
    """The literals and names that an expression may come to."""
    if isinstance(expression, ast.IfExp):
        yield from (*_ways(expression.body), *_ways(expression.orelse))
    elif isinstance(expression, ast.BoolOp):
        for each in expression.values:
            yield from _ways(each)
    elif isinstance(expression, ast.Constant | ast.Name):
        yield expression


def _never_shown(tree):
    """Literals that are no words, are words of the log, or that the classes tell themselves."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr):
            yield node.value  # a docstring
        elif isinstance(node, ast.JoinedStr):
            yield from node.values
        elif isinstance(node, ast.Call) and _is_told_elsewhere(node):
            yield from ast.walk(node)
        elif isinstance(node, ast.Call) and _name(node) in LOOKED_UP:
            yield from node.args[1:]
        elif isinstance(node, ast.Assign) and _name(node.targets[0]).startswith("bl_"):
            yield from ast.walk(node.value)
        elif isinstance(node, ast.AnnAssign | ast.arg) and node.annotation is not None:
            yield from ast.walk(node.annotation)
        elif isinstance(node, ast.FunctionDef) and node.returns is not None:
            yield from ast.walk(node.returns)
        elif isinstance(node, ast.Raise):
            yield from ast.walk(node)


def _is_told_elsewhere(call):
    return _name(call).endswith("Property") or _name(call) == "report"


def _name(node):
    node = getattr(node, "func", node)
    return getattr(node, "attr", None) or getattr(node, "id", None) or ""
