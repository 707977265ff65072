"""Undo and redo of the add-on's operators, which only a Blender with a window can do.

Each operator must change the file, undo must give back what was before, redo what was after.
"""

import hashlib
from collections.abc import Callable, Iterator

import bpy
from window import PAUSE, Window, check, say

Operators = tuple[tuple[str, dict], ...]
OPERATORS: Operators = (
    ("do_action", {"action": 2}),
    ("insert_action_key", {"action": "A3"}),
    ("delete_action_key", {}),
    ("hold_pose", {"hold": True}),
    ("hold_pose", {"hold": False}),
    ("leave_path", {}),
    ("follow_path", {"extent": "ALL"}),
    ("bake_paths", {}),
    ("add_ground_point", {}),
    ("remove_ground_point", {}),
    ("use_exact_colours", {}),
    ("detect_boxes", {}),
    ("open_picture", {}),
    ("make_not_playable", {}),
)
"""In an order in which each finds something to do; all stay done."""
FIELDS = ("is_playable", "object_name", "action", "use_mask", "use_layer")


def undo_and_redo(window: Window, choose: Callable, players: Callable) -> Iterator:
    """Go through all of them, there, back and there again."""
    scene = bpy.context.scene
    scene.playable_environment.playing.update_paths = False
    scene.frame_set(5)
    # Something to do for those that set things right.
    scene.render.dither_intensity = 1.0
    scene.camera.location.x += 0.3
    scene.camera.keyframe_insert("location", frame=20)
    for name, arguments in OPERATORS:
        choose(players()["player_1"])
        bpy.ops.ed.undo_push(message=f"before {name}")
        before = fingerprint()
        with window.area_of("VIEW_3D"):
            done = getattr(bpy.ops.playable, name)("EXEC_DEFAULT", True, **arguments)
        yield PAUSE
        after = fingerprint()
        check(done == {"FINISHED"}, f"{name} ended with {done}")
        check(after != before, f"{name} changed nothing")
        bpy.ops.ed.undo()
        yield PAUSE
        check(fingerprint() == before, f"{name} is not undone: {difference(before)}")
        bpy.ops.ed.redo()
        yield PAUSE
        check(fingerprint() == after, f"{name} is not redone: {difference(after)}")
        say(f"{name}: undone and redone")


def fingerprint() -> dict[str, object]:
    """What the add-on's operators change in a file, by what it is."""
    scene = bpy.context.scene
    settings = scene.playable_environment
    found: dict[str, object] = {
        "boxes": {each.name: tuple(each.box) for each in settings.boxes},
        "points": [(tuple(p.place), tuple(p.pixel)) for p in settings.framing.points],
        "open": settings.framing.is_open,
        "dither": scene.render.dither_intensity,
        "camera": scene.camera.name if scene.camera else "",
        "bake": _digest(settings.bake_text),
        "state": _digest(settings.state_text),
    }
    for each in scene.objects:
        if not each.playable.object_name:
            continue
        own = each.playable.overrides
        found[each.name] = (
            *(getattr(each.playable, name) for name in FIELDS),
            (own.place, own.style, own.pose),
            _keys(each),
        )
    return found


def difference(wanted: dict[str, object]) -> str:
    """What is not as it should be."""
    now = fingerprint()
    return ", ".join(name for name in wanted if now.get(name) != wanted[name]) or "nothing"


def _digest(block: bpy.types.Text | None) -> str:
    return hashlib.sha256(block.as_string().encode()).hexdigest() if block else ""


def _keys(target: bpy.types.Object) -> list:
    animation = target.animation_data
    if animation is None or animation.action is None:
        return []
    bags = (
        strip.channelbag(animation.action_slot)
        for layer in animation.action.layers
        for strip in layer.strips
    )
    return [
        (curve.data_path, curve.array_index, tuple(tuple(key.co) for key in curve.keyframe_points))
        for bag in bags
        if bag is not None
        for curve in bag.fcurves
    ]
