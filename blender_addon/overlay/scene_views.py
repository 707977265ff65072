"""What a scene has to show, taken out of Blender's data for the modules that know none of it."""

from collections.abc import Mapping, Sequence

import bpy
import numpy as np

from pe_runtime.contract.shot import Shot

from ..bake import Bake, bake_of
from ..framing.cameras import seen_by
from ..framing.framed import framed_picture
from ..scene_bridge import action_names, playable_objects, world_from_environment
from ..volumes import volumes_in
from .foreseen_paths import Foresight, Path
from .framed_view import view_of
from .keyed_ways import keyed_way, keys_of
from .picture_marks import PictureView

_views: dict[str, tuple[tuple, PictureView]] = {}
_foresights: dict[str, tuple[tuple, Foresight]] = {}


def picture_view_of(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> PictureView | None:
    """The picture that a scene is being made from; None where there is none, or it is made.

    The same one as long as nothing has changed.
    """
    framed = framed_picture(scene)
    if framed is None:
        return None
    eye = framed.camera
    if eye is None:
        holder = scene.objects.get(framed.holder)
        if holder is None:
            return None
        matrix = world_from_environment(depsgraph)
        eye = seen_by(holder.evaluated_get(depsgraph), scene.render, matrix, framed.size)
    # The usual camera goes by no points: they would only seem to miss.
    mode = scene.playable_environment.framing.camera_mode
    source, view = _views.get(scene.name, (None, None))
    if source is None or source[0] is not framed or source[1:] != (eye, mode):
        view = view_of(framed, eye, with_points=mode != "USUAL")
        _views[scene.name] = (framed, eye, mode), view
    return view


def foresight_of(scene: bpy.types.Scene) -> Foresight | None:
    """The paths of a scene's playable objects, as far as they are known; None where they are not.

    The same one as long as nothing has changed, so that whoever draws it can tell.
    """
    settings = scene.playable_environment
    if settings.root is None or settings.bake_text is None:
        return None
    return _foresight(scene, bake_of(settings))


def _foresight(scene: bpy.types.Scene, bake: Bake) -> Foresight:
    objects = playable_objects(scene)
    keys = tuple(keys_of(each) for each in objects.values())
    source, found = _foresights.get(scene.name, (None, None))
    # Compared by identity: two bakes are as large as they are seldom equal.
    if found is not None and source[0] is bake and source[1:] == (keys, scene.frame_current):
        return found
    volumes, shot = volumes_in(scene), bake.shot
    paths = tuple(
        Path(
            name,
            _way(objects.get(name), scene, shot, predicted),
            bake.headings.get(name),
            _named_keys(shot, name, action_names(objects[name]) if name in objects else ()),
            volumes.get(name),
        )
        for name, predicted in bake.paths.items()
    )
    per_step = shot.fps / scene.playable_environment.steps_per_second
    made = Foresight(paths, shot.frame_start, scene.frame_current, per_step)
    _foresights[scene.name] = (bake, keys, scene.frame_current), made
    return made


def _way(
    each: bpy.types.Object | None, scene: bpy.types.Scene, shot: Shot, predicted: np.ndarray
) -> np.ndarray:
    """The way that renders show: by its keys where they tell, as predicted elsewhere."""
    if each is None:
        return predicted
    keyed = keyed_way(each, scene.playable_environment.root, shot.frames)
    return predicted if keyed is None else keyed


def _named_keys(shot: Shot, name: str, names: Sequence[str]) -> list[tuple[int, str]]:
    track = shot.track(name)
    keys: Mapping[int, int] = dict(track.actions) if track else {}
    return [
        (frame, names[action].replace("_", " ").capitalize())
        for frame, action in sorted(keys.items())
        if 0 <= action < len(names)
    ]
