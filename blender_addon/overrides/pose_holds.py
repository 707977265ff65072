"""Since which frame a pose is held, told by the keys: a frame is drawn without the others.

Blender evaluates one frame; when its holding began, only the history of the keys can tell.
"""

import math

import bpy

from pe_runtime.contract.errors import ShotError

from ..fcurves import SAME_FRAME, curves_of, key_points, strip_curves

POSE_PATH = "playable.overrides.pose"
HELD = 1
ALWAYS = -(2**31)
"""Held without beginning: since the first frame, whichever that is."""


def held_since(target: bpy.types.Object, frame: int) -> int | None:
    """The first frame of the holding that is in force at a frame.

    Args:
        target: The original object, not the evaluated one.
        frame: A frame at which its pose property says Held.

    Returns:
        `ALWAYS` where there are no keys. None before the first key, whose value Blender shows
        there too: what it begins has not begun.

    Raises:
        ShotError: The keys do not tell, because drivers or mixed NLA strips decide.
    """
    earliest = _earliest_change(target)
    if earliest is None:
        return ALWAYS
    if frame < earliest:
        return None
    if _pose_at(target, frame) != HELD:
        raise ShotError(
            f"the pose of {target.name!r} is held at frame {frame} by a driver or by mixed NLA "
            "strips, so that nobody can tell since when; key Pose on the object itself"
        )
    since = frame
    while since > earliest and _pose_at(target, since - 1) == HELD:
        since -= 1
    return since


def _earliest_change(target: bpy.types.Object) -> int | None:
    """The frame before which nothing changes; None where nothing animates the pose."""
    animation = target.animation_data
    if animation is None:
        return None
    if any(each.data_path == POSE_PATH for each in animation.drivers):
        return ALWAYS
    frames = [float(key_points(each)[0, 0]) for each in _own(target) if len(each.keyframe_points)]
    if animation.use_nla:
        strips = (strip for track in animation.nla_tracks for strip in track.strips)
        frames += [strip.frame_start for strip in strips if _curve_of(strip) is not None]
    return math.ceil(min(frames) - SAME_FRAME) if frames else None


def _own(target: bpy.types.Object) -> list:
    return [
        each
        for each in curves_of(target) or ()
        if each.data_path == POSE_PATH and not each.mute and each.is_valid
    ]


def _curve_of(strip: bpy.types.NlaStrip) -> bpy.types.FCurve | None:
    return next((each for each in strip_curves(strip) if each.data_path == POSE_PATH), None)


def _pose_at(target: bpy.types.Object, frame: int) -> int | None:
    """The number of the pose that the keys give at a frame; None where a driver does."""
    animation = target.animation_data
    if any(each.data_path == POSE_PATH for each in animation.drivers):
        return None
    if own := _own(target):
        return int(own[0].evaluate(frame))
    tracks = [track for track in animation.nla_tracks if not track.mute]
    tracks = [track for track in tracks if track.is_solo] or tracks
    for track in reversed(tracks):
        if (value := _track_at(track, frame)) is not None:
            return value
    return 0


def _track_at(track: bpy.types.NlaTrack, frame: int) -> int | None:
    """What a track of strips gives at a frame; None where it says nothing there."""
    before = None
    for strip in track.strips:
        curve = None if strip.mute else _curve_of(strip)
        if curve is None:
            continue
        if frame < strip.frame_start:
            if before is None and strip.extrapolation == "HOLD":
                return _strip_at(strip, curve, strip.frame_start)
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
