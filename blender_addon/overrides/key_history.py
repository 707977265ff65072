"""What the keys of an enum say of other frames: since when a pose is held, what has begun at all.

Blender evaluates one frame, and shows the value of the first key before it too. For overrides, what
a key begins has not begun before it.
"""

import math

import bpy

from pe_runtime.contract.errors import ShotError

from ..fcurves import SAME_FRAME, curves_of, key_points, make_stepped, own_curves, strip_curves

POSE_PATH = "playable.overrides.pose"
PLACE_PATH = "playable.overrides.place"
HELD = 1
ALWAYS = -(2**31)
"""Without beginning: since the first frame, whichever that is."""


def held_since(target: bpy.types.Object, frame: int) -> int | None:
    """The first frame of the holding that is in force at a frame.

    Args:
        target: The original object, not the evaluated one.
        frame: A frame at which its pose property says Held.

    Returns:
        `ALWAYS` where there are no keys; None before the first key.

    Raises:
        ShotError: The keys do not tell, because drivers or mixed NLA strips decide.
    """
    earliest = first_change(target, POSE_PATH)
    if earliest == ALWAYS and not _is_driven(target, POSE_PATH):
        return ALWAYS
    if frame < earliest:
        return None
    if _value_at(target, POSE_PATH, frame) != HELD:
        raise ShotError(
            f"the pose of {target.name!r} is held at frame {frame} by a driver or by mixed NLA "
            "strips, so that nobody can tell since when; key Pose on the object itself"
        )
    since = frame
    while since > earliest and _value_at(target, POSE_PATH, since - 1) == HELD:
        since -= 1
    return since


def first_change(target: bpy.types.Object, data_path: str) -> int:
    """The first frame that a key or a strip decides about; `ALWAYS` where none or a driver does."""
    animation = target.animation_data
    if animation is None or _is_driven(target, data_path):
        return ALWAYS
    own = _own_curves(target, data_path)
    frames = [float(key_points(each)[0, 0]) for each in own if len(each.keyframe_points)]
    if animation.use_nla:
        strips = (strip for track in animation.nla_tracks for strip in track.strips)
        frames += [each.frame_start for each in strips if _curve_of(each, data_path) is not None]
    return math.ceil(min(frames) - SAME_FRAME) if frames else ALWAYS


def key_from(target: bpy.types.Object, data_path: str, frame: int, value: str, before: str) -> None:
    """Key an override so that it begins at a frame, and is seen not to have begun before.

    Args:
        target: The object.
        data_path: The override, an enum.
        frame: Where it begins.
        value: What it is from there on.
        before: What it was, keyed one frame earlier where nothing is keyed yet.

    Raises:
        ShotError: The object is linked from another file.
    """
    own_curves(target)
    if frame <= first_change(target, data_path) or first_change(target, data_path) == ALWAYS:
        _key(target, data_path, frame - 1, before)
    _key(target, data_path, frame, value)
    make_stepped(target, data_path)


def _key(target: bpy.types.Object, data_path: str, frame: int, value: str) -> None:
    setattr(target.playable.overrides, data_path.rpartition(".")[2], value)
    target.keyframe_insert(data_path, frame=frame)


def _is_driven(target: bpy.types.Object, data_path: str) -> bool:
    animation = target.animation_data
    return animation is not None and any(d.data_path == data_path for d in animation.drivers)


def _own_curves(target: bpy.types.Object, data_path: str) -> list[bpy.types.FCurve]:
    curves = curves_of(target) or ()
    return [each for each in curves if each.data_path == data_path and not each.mute]


def _curve_of(strip: bpy.types.NlaStrip, data_path: str) -> bpy.types.FCurve | None:
    return next((each for each in strip_curves(strip) if each.data_path == data_path), None)


def _value_at(target: bpy.types.Object, data_path: str, frame: int) -> int | None:
    """The number that the keys give at a frame; None where a driver does."""
    if _is_driven(target, data_path):
        return None
    if own := _own_curves(target, data_path):
        return int(own[0].evaluate(frame))
    tracks = [track for track in target.animation_data.nla_tracks if not track.mute]
    tracks = [track for track in tracks if track.is_solo] or tracks
    for track in reversed(tracks):
        if (value := _track_at(track, data_path, frame)) is not None:
            return value
    return 0


def _track_at(track: bpy.types.NlaTrack, data_path: str, frame: int) -> int | None:
    """What a track of strips gives at a frame; None where it says nothing there."""
    before = None
    for strip in track.strips:
        curve = None if strip.mute else _curve_of(strip, data_path)
        if curve is None:
            continue
        if frame < strip.frame_start:
            break
        before = strip, curve
        if frame <= strip.frame_end:
            return _strip_at(strip, curve, frame)
    if before is None or before[0].extrapolation == "NOTHING":
        return None
    return _strip_at(*before, before[0].frame_end)


def _strip_at(strip: bpy.types.NlaStrip, curve: bpy.types.FCurve, frame: float) -> int:
    inside = (frame - strip.frame_start) / strip.scale
    length = strip.action_frame_end - strip.action_frame_start
    if strip.repeat > 1.0 and length > 0 and inside > length:
        inside %= length
    if strip.use_reverse:
        inside = length - inside
    return int(curve.evaluate(strip.action_frame_start + inside))
