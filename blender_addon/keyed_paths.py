"""Predicted paths as keys on the playable Empties: LINEAR, one for every frame.

What cannot act by itself is left to the artist: its location and rotation are never keyed here.
"""

import math
from collections.abc import Mapping, Sequence

import bpy
import numpy as np

from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.shot import Shot

from .bake import Bake
from .fcurves import own_curves, write_curve
from .playables import write_text
from .scene_bridge import Moment, action_names, playable_objects
from .worker.replies import PredictedPaths

UPRIGHT_TOLERANCE = 1e-4
SAME_PLACE = 1e-4
"""Metres or radians by which two predictions of one path may differ on different machines."""
NOT_EULER = ("QUATERNION", "AXIS_ANGLE")
Channels = dict[tuple[str, int], np.ndarray]


def write_bake(
    scene: bpy.types.Scene, shot: Shot, predicted: PredictedPaths, moments: Sequence[Moment]
) -> None:
    """Key predicted paths on the Empties and remember the shot they belong to; main thread only.

    Where an Empty is free of its path, its keys stay.

    Args:
        scene: The scene that the shot was sampled from.
        shot: The shot that was rolled out.
        predicted: What the worker answered.
        moments: The sampled frames of the shot.

    Raises:
        ShotError: A path is missing or too short, or an Empty cannot take it.
    """
    _key_paths(scene, baked_from(shot, predicted), moments, shot.frame_start)
    scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)


def continue_bake(
    scene: bpy.types.Scene, before: Bake | None, made: Bake, moments: Sequence[Moment], since: int
) -> None:
    """Key new paths from a frame on; keys before it stay to the bit. Main thread only.

    Unlike `write_bake`, this leaves alone whatever else has been moved but not keyed yet.

    Args:
        scene: The scene that the shot was sampled from.
        before: What was baked; where the new paths do not go on from it, all is keyed anew.
        made: What was predicted.
        moments: The sampled frames of the shot.
        since: First frame that may have changed.

    Raises:
        ShotError: An Empty cannot take its path.
    """
    head = since - made.shot.frame_start
    if before is None or not _goes_on(before, made, head):
        since = made.shot.frame_start
    else:
        made = Bake(
            made.shot,
            {name: _spliced(before.paths[name], path, head) for name, path in made.paths.items()},
            {n: _spliced(before.headings[n], turns, head) for n, turns in made.headings.items()},
        )
    _key_paths(scene, made, moments, since)
    for each in playable_objects(scene).values():
        each.update_tag(refresh={"TIME"})


def restore_path(
    scene: bpy.types.Scene,
    target: bpy.types.Object,
    bake: Bake,
    moments: Sequence[Moment],
    restored: np.ndarray,
) -> None:
    """Key the baked path of one object again.

    Args:
        scene: Its scene.
        target: The object.
        bake: The scene's.
        moments: The sampled frames of the baked shot.
        restored: (frames,) at which of them; keys at the others stay.

    Raises:
        ShotError: The object cannot take its path.
    """
    name, shot = target.playable.object_name, bake.shot
    local = _local_spaces(target, scene, moments)
    channels = _channels(target, bake.paths[name], bake.headings.get(name), local)
    frames, curves = np.arange(shot.frame_start, shot.frame_end + 1.0), own_curves(target)
    for channel, values in channels.items():
        write_curve(curves, channel, frames, values, restored)


def baked_from(shot: Shot, predicted: PredictedPaths) -> Bake:
    """The bake of a shot and what the worker answered; needs no Blender.

    Raises:
        ShotError: A path is missing or too short.
    """
    frames, names = len(shot.frames), [track.name for track in shot.objects]
    paths = {name: _checked(name, predicted.positions, (frames, 3)) for name in names}
    turning = [name for name in names if name in predicted.headings]
    headings = {name: _checked(name, predicted.headings, (frames,)) for name in turning}
    return Bake(shot, paths, headings)


def _key_paths(scene: bpy.types.Scene, bake: Bake, moments: Sequence[Moment], since: int) -> None:
    objects, shot = playable_objects(scene), bake.shot
    # All of them first: an Empty that cannot take its path leaves the others as they were.
    channels = {
        name: _channels(
            each, bake.paths[name], bake.headings.get(name), _local_spaces(each, scene, moments)
        )
        for name, each in objects.items()
        if action_names(each)
    }
    frames = np.arange(shot.frame_start, shot.frame_end + 1, dtype=np.float64)
    # The last one in any case, so that what lies beyond it goes.
    anew = frames >= min(since, shot.frame_end)
    for name, values in channels.items():
        bound = np.array([not moment.tracks[name].override.free for moment in moments])
        if not bound.any():
            continue
        curves = own_curves(objects[name])
        for channel, each in values.items():
            has_head = curves.find(channel[0], index=channel[1]) is not None
            replaced = bound & anew if has_head else bound
            write_curve(curves, channel, frames, each, replaced)
    settings = scene.playable_environment
    settings.bake_text = write_text(settings.bake_text, f"{scene.name} bake", bake.to_json())


def _goes_on(before: Bake, made: Bake, head: int) -> bool:
    """Whether new paths are those of an earlier bake up to a frame."""
    then, now = before.shot, made.shot
    same = then.frame_start == now.frame_start and 0 < head <= len(then.frames)
    same = same and before.paths.keys() == made.paths.keys()
    if not same or before.headings.keys() != made.headings.keys():
        return False
    return all(
        np.allclose(old[name][:head], new[name][:head], rtol=0.0, atol=SAME_PLACE)
        for old, new in ((before.paths, made.paths), (before.headings, made.headings))
        for name in new
    )


def _spliced(before: np.ndarray, made: np.ndarray, head: int) -> np.ndarray:
    return np.concatenate([before[:head], made[head:]])


def _checked(name: str, found: Mapping[str, np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    values = np.asarray(found.get(name, ()), np.float64)
    if values.shape != shape or not np.isfinite(values).all():
        what = "positions" if len(shape) == 2 else "headings"
        raise ShotError(
            f"expected {shape[0]} finite {what} for {name!r} from the worker, found an array of "
            f"shape {values.shape}; use an add-on and a runtime of the same version"
        )
    return values


def _local_spaces(
    each: bpy.types.Object, scene: bpy.types.Scene, moments: Sequence[Moment]
) -> np.ndarray:
    """(frames, 4, 4) from environment space to that of the object's own channels."""
    if each.parent is not None and each.parent == scene.playable_environment.root:
        local_from_environment = np.linalg.inv(np.array(each.matrix_parent_inverse))
        return np.repeat(local_from_environment[None], len(moments), axis=0)
    if each.parent is None:
        return np.stack([moment.world_from_environment for moment in moments])
    raise ShotError(
        f"{each.name!r} is parented to {each.parent.name!r}; parent it to the environment root "
        "or to nothing, so that its path can be keyed"
    )


def _channels(
    each: bpy.types.Object, path: np.ndarray, headings: np.ndarray | None, local: np.ndarray
) -> Channels:
    """Key values per channel: locations, and the turn about z where it is predicted."""
    points = np.concatenate([path, np.ones((len(path), 1))], axis=1)
    points = np.einsum("fij,fj->fi", local, points)
    channels: Channels = {("location", axis): points[:, axis] for axis in range(3)}
    if headings is None:
        return channels
    if each.rotation_mode in NOT_EULER:
        raise ShotError(
            f"{each.name!r} turns by {each.rotation_mode.lower().replace('_', ' ')}s, but headings "
            "are keyed as Euler angles; set its rotation mode to XYZ Euler"
        )
    up = local[:, 2, 2] / np.linalg.norm(local[:, :3, 2], axis=1)
    if (up < 1.0 - UPRIGHT_TOLERANCE).any():
        raise ShotError(
            f"{each.name!r} stands in a space that is tilted against the environment, so that its "
            "heading is no turn about its own z; parent it to the environment root"
        )
    turns = headings + np.arctan2(local[:, 1, 0], local[:, 0, 0])
    channels["rotation_euler", 2] = np.unwrap(turns, period=math.tau)
    return channels
