"""Actions hold from key to key, whatever was done to their keys; what would blend them is named."""

from collections.abc import Iterator

import bpy

from ..fcurves import ACTION_PATH, curves_of, make_stepped, strip_curves


def playables_in(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The playable objects of a scene by name, however many claim to be the same one."""
    found = (each for each in scene.objects if each.playable.is_playable)
    return sorted(found, key=lambda each: each.name_full)


def step_actions(scene: bpy.types.Scene) -> int:
    """Make all action keys of a scene hold until the next; how many curves had others.

    Main thread only. Keys in linked files stay as they are; they are read as if they held.
    """
    return sum(make_stepped(each, ACTION_PATH) for each in playables_in(scene))


def action_warnings(scene: bpy.types.Scene) -> list[str]:
    """What makes actions something else than their keys say, in words; empty if all is well.

    Blender blends enums like numbers: half of action 4 is action 2, which nobody has keyed.
    """
    return [text for each in playables_in(scene) for text in _warnings_for(each)]


def _warnings_for(each: bpy.types.Object) -> Iterator[str]:
    animation = each.animation_data
    if animation is None:
        return
    if any(driver.data_path == ACTION_PATH for driver in animation.drivers):
        yield f"{each.name!r}: a driver sets the action; its keys have no effect"
    own = curves_of(each)
    curve = own.find(ACTION_PATH) if own is not None else None
    if curve is not None and (curve.mute or (curve.group is not None and curve.group.mute)):
        yield f"{each.name!r}: the curve of its action is muted; its keys have no effect"
    if not animation.use_nla:
        return
    for track, strip in _acting_strips(animation):
        for problem in _strip_problems(animation, track, strip):
            yield f"{each.name!r}: NLA strip {strip.name!r} {problem}"
    if curve is not None and len(animation.nla_tracks):
        problem = _top_problem(animation)
        if problem:
            yield f"{each.name!r}: its action {problem}"


def _acting_strips(
    animation: bpy.types.AnimData,
) -> Iterator[tuple[bpy.types.NlaTrack, bpy.types.NlaStrip]]:
    for track in animation.nla_tracks:
        for strip in track.strips:
            if any(curve.data_path == ACTION_PATH for curve in strip_curves(strip)):
                yield track, strip


def _strip_problems(
    animation: bpy.types.AnimData, track: bpy.types.NlaTrack, strip: bpy.types.NlaStrip
) -> Iterator[str]:
    alone = any(other.is_solo for other in animation.nla_tracks)
    if track.mute or strip.mute or (alone and not track.is_solo):
        yield "is muted; the action keys in it have no effect"
        return
    if strip.use_animated_influence and _least_influence(strip) < 1.0:
        yield "has an influence below 1 and would blend actions; set it to 1"
    if strip.use_auto_blend or strip.blend_in > 0 or strip.blend_out > 0:
        yield "blends in or out and would blend actions; set both to 0"
    if strip.blend_type != "REPLACE":
        yield f"is added by {strip.blend_type.capitalize()} and would mix actions; choose Replace"


def _least_influence(strip: bpy.types.NlaStrip) -> float:
    curve = strip.fcurves.find("influence")
    if curve is None or not len(curve.keyframe_points):
        return strip.influence
    return min(point.co[1] for point in curve.keyframe_points)


def _top_problem(animation: bpy.types.AnimData) -> str:
    if animation.action_influence < 1.0:
        return "has an influence below 1 over its NLA strips and would blend; set it to 1"
    if animation.action_blend_type != "REPLACE":
        return "is mixed with its NLA strips; choose Replace"
    return ""
