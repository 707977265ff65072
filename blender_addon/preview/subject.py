"""What a viewport shows of a scene, whoever looks at it; read on the main thread."""

import dataclasses
import json
from dataclasses import dataclass
from functools import lru_cache

import bpy
import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.shot import SHOT_VERSION, ObjectTrack, Shot, Start

from ..bake import Bake, Output, bake_of, take_of_moment
from ..playables import stored_start
from ..scene_bridge import (
    Moment,
    TrackMoment,
    frames_per_second,
    inverse_of,
    read_tracks,
    world_from_environment,
)
from ..worker.worker_operator import model_path
from .desk import Wish

QUALITY = "draft"
REST_FRAME = 1


@dataclass(frozen=True)
class Subject:
    """A scene at a frame.

    Attributes:
        take: The frame, seen by any camera.
        whole: The shot that it is a take of.
        environment_from_world: (4, 4) float64.
    """

    take: Shot
    whole: Shot
    environment_from_world: np.ndarray

    def seen_by(self, camera: Camera) -> Wish:
        """What a camera sees of it, environment space."""
        return Wish(dataclasses.replace(self.take, cameras=(camera,)), self.whole)


def read_subject(depsgraph: bpy.types.Depsgraph) -> Subject:
    """The scene of a viewport at its frame: as baked, or at rest where nothing is.

    Raises:
        ShotError: There is no environment, or it does not fit what was baked.
        CameraError: The environment root is stretched or mirrored.
    """
    scene = depsgraph.scene
    settings, matrix = scene.playable_environment, world_from_environment(depsgraph)
    if settings.root is None:
        raise ShotError("this scene has no environment; make one with New Playable Environment")
    tracks = read_tracks(depsgraph, matrix)
    if settings.bake_text is None:
        bake = _bake_at_rest(scene, tuple(tracks))
    else:
        bake = bake_of(settings)
    take = _take_at(bake, depsgraph.scene_eval.frame_current, tracks, matrix)
    return Subject(take, bake.shot, inverse_of(matrix))


def _take_at(bake: Bake, frame: int, tracks: dict[str, TrackMoment], matrix: np.ndarray) -> Shot:
    """One frame of a bake with the objects where the scene has them now."""
    shot = bake.shot
    # Beyond the baked range, and where actions have changed since, objects stand where they are
    # in the nearest baked pose: a preview need not refuse that.
    nearest = min(max(frame, shot.frame_start), shot.frame_end)
    standing = {name: _standing(each, nearest) for name, each in tracks.items()}
    eye = shot.camera_at(nearest)
    moment = Moment(nearest, eye, matrix, standing)
    return take_of_moment(bake, moment, shot.fps, Output(eye.width, eye.height, QUALITY))


def _standing(track: TrackMoment, frame: int) -> TrackMoment:
    """An object as it stands, whatever it does; a pose can be held since this frame at the latest.

    Args:
        track: At the scene's frame.
        frame: The baked frame that is nearest to it.
    """
    override = track.override
    if override.held_since is not None:
        override = dataclasses.replace(override, held_since=min(override.held_since, frame))
    return dataclasses.replace(track, action=None, override=override)


def _bake_at_rest(scene: bpy.types.Scene, names: tuple[str, ...]) -> Bake:
    """A bake of a single frame: the state as it was encoded, before anybody acts."""
    settings = scene.playable_environment
    start = json.dumps(stored_start(settings).as_dict())
    text, pace = settings.state_text.as_string(), frames_per_second(scene)
    return _rest(text, start, model_path(settings.model), pace, names)


@lru_cache(maxsize=4)
def _rest(state_text: str, start: str, model: str, fps: float, names: tuple[str, ...]) -> Bake:
    # Remembered, so that the worker is asked to prepare the same shot once.
    found = json.loads(state_text)
    objects, eye = found["state"]["objects"], found["start"]["camera"]
    shot = Shot(
        version=SHOT_VERSION,
        model=model,
        start=Start.from_dict(json.loads(start)),
        fps=fps,
        frame_start=REST_FRAME,
        frame_end=REST_FRAME,
        cameras=(Camera.from_dict(eye),),
        objects=tuple(ObjectTrack(name) for name in names),
        quality=QUALITY,
    )
    places = {name: np.array([objects[name]["position"]], np.float64) for name in names}
    headings = {name: np.array([objects[name].get("heading", 0.0)]) for name in names}
    return Bake(shot, places, headings)
