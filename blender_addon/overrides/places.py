"""Leaving the predicted path by keys, and following it again.

While an object is free, its location and turn are the artist's: baking keys only the other frames.
"""

import math

import bpy
import numpy as np

from pe_runtime.contract.errors import ShotError

from ..bake import Bake
from ..fcurves import SAME_FRAME, curves_of, own_curves, remove_curves
from ..keyed_paths import restore_path
from ..scene_bridge import Moment, action_names
from .key_history import PLACE_PATH, first_change, key_from

LOCATION, TURN = "location", "rotation_euler"
FREE = 1
FRAME, ONWARDS, ALL = "FRAME", "ONWARDS", "ALL"


def leave_path(target: bpy.types.Object, frame: int) -> None:
    """Free an object of its path from the current frame on, until its next Follow key.

    It stays where it stands until it is keyed elsewhere.

    Raises:
        ShotError: It is free already, or linked from another file.
    """
    begun = frame >= first_change(target, PLACE_PATH)
    if target.playable.overrides.place == "FREE" and begun:
        raise ShotError(
            f"{target.name!r} is free of its path at frame {frame} already; key its location"
        )
    curves = own_curves(target)
    target.keyframe_insert(LOCATION, frame=frame)
    if curves.find(TURN, index=2) is not None:
        target.keyframe_insert(TURN, index=2, frame=frame)
    end = _next_key(curves.find(PLACE_PATH), frame)
    for curve in curves:
        if curve.data_path in (LOCATION, TURN):
            _remove_between(curve, frame, end)
    key_from(target, PLACE_PATH, frame, "FREE", "FOLLOW")
    target.update_tag(refresh={"TIME"})


def follow_path(
    scene: bpy.types.Scene,
    target: bpy.types.Object,
    bake: Bake,
    moments: list[Moment],
    extent: str,
) -> None:
    """Put an object back on its baked path at the current frame, from it on, or everywhere.

    Args:
        scene: Its scene.
        target: The object.
        bake: The scene's.
        moments: The sampled frames of the baked shot.
        extent: FRAME, ONWARDS or ALL.

    Raises:
        ShotError: The frame is not baked, or the object cannot take its path.
    """
    frame, shot = scene.frame_current, bake.shot
    frames = np.arange(shot.frame_start, shot.frame_end + 1)
    if extent != ALL and frame not in shot.frames:
        raise ShotError(
            f"frame {frame} is outside the baked range {shot.frame_start} to {shot.frame_end}; "
            "go to a baked frame"
        )
    masks = {FRAME: frames == frame, ONWARDS: frames >= frame, ALL: np.ones(len(frames), bool)}
    restore_path(scene, target, bake, moments, masks[extent])
    _follow_keys(target, frame, extent)
    if extent == ALL and not action_names(target):
        _stand_still(target, shot.frame_start)
    target.update_tag(refresh={"TIME"})


def _follow_keys(target: bpy.types.Object, frame: int, extent: str) -> None:
    """Have the keys of Place say Follow there."""
    curves = curves_of(target)
    curve = curves.find(PLACE_PATH) if curves is not None else None
    if extent == ALL or curve is None:
        remove_curves(target, PLACE_PATH)
        target.playable.overrides.place = "FOLLOW"
    elif extent == ONWARDS:
        _remove_between(curve, frame, math.inf)
        key_from(target, PLACE_PATH, frame, "FOLLOW", "FOLLOW")
    elif int(curve.evaluate(frame)) == FREE:
        goes_on = int(curve.evaluate(frame + 1)) == FREE
        if goes_on:
            key_from(target, PLACE_PATH, frame + 1, "FREE", "FREE")
        key_from(target, PLACE_PATH, frame, "FOLLOW", "FOLLOW")


def _stand_still(target: bpy.types.Object, frame: int) -> None:
    """Leave an object that cannot act where it is predicted, without keys of its own."""
    for curve in curves_of(target) or ():
        if curve.data_path in (LOCATION, TURN):
            getattr(target, curve.data_path)[curve.array_index] = curve.evaluate(frame)
    remove_curves(target, LOCATION)
    remove_curves(target, TURN)


def _next_key(curve: bpy.types.FCurve | None, frame: int) -> float:
    later = (point.co[0] for point in (curve.keyframe_points if curve else ()))
    return min((each for each in later if each > frame + SAME_FRAME), default=math.inf)


def _remove_between(curve: bpy.types.FCurve, after: float, before: float) -> None:
    """Delete the keys that lie strictly between two frames."""
    points = curve.keyframe_points
    for index in reversed(range(len(points))):
        if after + SAME_FRAME < points[index].co[0] < before - SAME_FRAME:
            points.remove(points[index], fast=True)
    curve.update()
