"""The action keys of playable objects: whose they are, where they lie, which one is next."""

from collections.abc import Iterable

import bpy

from pe_runtime.contract.errors import ShotError

from ..fcurves import ACTION_PATH, SAME_FRAME, curves_of, key_points, own_curves


def players_at_hand(
    layer: bpy.types.ViewLayer, active: bpy.types.Object | None
) -> list[bpy.types.Object]:
    """The playable objects that a key press is meant for: none unless the active object is one.

    Args:
        layer: Its selected playable objects are meant, with the active one first.
        active: The active object.
    """
    if active is None or not active.playable.is_playable:
        return []
    others = (each for each in layer.objects.selected if each != active)
    return [active, *(each for each in others if each.playable.is_playable)]


def next_playable(
    layer: bpy.types.ViewLayer, active: bpy.types.Object | None
) -> bpy.types.Object | None:
    """The playable object after the active one, by name and in a circle; None without any."""
    shown = [e for e in layer.objects if e.playable.is_playable and e.visible_get(view_layer=layer)]
    shown.sort(key=lambda each: each.name)
    if active not in shown:
        return shown[0] if shown else None
    return shown[(shown.index(active) + 1) % len(shown)]


def keyed_frames(target: bpy.types.Object) -> list[int]:
    """The frames of an object's own action keys, in order."""
    curves = curves_of(target)
    curve = curves.find(ACTION_PATH) if curves is not None else None
    return [] if curve is None else [round(float(frame)) for frame in key_points(curve)[:, 0]]


def neighbour(frames: Iterable[int], now: int, forward: bool) -> int | None:
    """The nearest of some frames after or before this one."""
    if forward:
        return min((frame for frame in frames if frame > now), default=None)
    return max((frame for frame in frames if frame < now), default=None)


def delete_key_at(target: bpy.types.Object, frame: int) -> bool:
    """Delete an object's action key at a frame; whether there was one.

    Raises:
        ShotError: The object is linked from another file.
    """
    if frame not in keyed_frames(target):
        return False
    if not target.is_editable:
        raise ShotError(f"{target.name!r} is linked from another file; its keys are deleted there")
    curves = own_curves(target)
    curve = curves.find(ACTION_PATH)
    for index in reversed(range(len(curve.keyframe_points))):
        if abs(curve.keyframe_points[index].co[0] - frame) < 0.5 - SAME_FRAME:
            curve.keyframe_points.remove(curve.keyframe_points[index])
    if len(curve.keyframe_points):
        curve.update()
    else:
        curves.remove(curve)
    target.update_tag(refresh={"TIME"})
    return True
