"""The baked shot: what the worker predicted paths for, kept in the .blend and filmed later.

A frame is rendered from the baked shot, changed only where the artist has since moved the camera,
or moved, turned, shown or hidden an Empty, at that frame. Other changes ask for another bake.
"""

import dataclasses
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.shot import ObjectTrack, Shot

from .scene_bridge import Moment, TrackMoment

FORMAT = 1
BAKE_AGAIN = "press Bake Paths again"
# Locations pass through float32 F-curves and the root's matrix: below this nobody has moved it.
MOVED_METRES = 1e-4
TURNED_RADIANS = 1e-4
CAMERA_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Bake:
    """A shot and the paths that were predicted for it.

    Attributes:
        shot: As it was sent to the worker, without location overrides.
        paths: Per object (frames, 3) float64 positions in environment space, metres.
        headings: Per object (frames,) float64 radians about z; only where the model predicts them.
    """

    shot: Shot
    paths: Mapping[str, np.ndarray]
    headings: Mapping[str, np.ndarray] = field(default_factory=dict)

    def to_json(self) -> str:
        """The bake as the text of a Blender text block."""
        paths = {name: np.asarray(path).tolist() for name, path in self.paths.items()}
        headings = {name: np.asarray(each).tolist() for name, each in self.headings.items()}
        content = {
            "format": FORMAT,
            "digest": self.shot.digest(),
            "shot": self.shot.as_dict(),
            "paths": paths,
            "headings": headings,
        }
        return json.dumps(content, allow_nan=False)


@lru_cache(maxsize=4)
def read_bake(text: str, where: str) -> Bake:
    """Read what `Bake.to_json` wrote; remembered, since every frame asks.

    Raises:
        ShotError: The text is no bake, or was changed by hand.
    """
    try:
        content = json.loads(text)
        stored, digest = content["shot"], content["digest"]
        paths = {name: np.array(path, np.float64) for name, path in content["paths"].items()}
        # Bakes from before there were headings have none.
        headings = content.get("headings", {}).items()
        headings = {name: np.array(each, np.float64) for name, each in headings}
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ShotError(f"{where!r} is no bake ({error!r}); {BAKE_AGAIN}") from error
    shot = Shot.from_dict(stored, where)
    if shot.digest() != digest:
        raise ShotError(f"{where!r} was edited since it was baked; {BAKE_AGAIN}")
    return Bake(shot, paths, headings)


def bake_of(settings: object) -> Bake:
    """The bake that a scene's settings hold.

    Raises:
        ShotError: Nothing was baked yet.
    """
    if settings.root is None:
        raise ShotError("this scene has no environment; make one with New Playable Environment")
    if settings.bake_text is None:
        raise ShotError("nothing is baked yet; press Bake Paths before rendering")
    return read_bake(settings.bake_text.as_string(), settings.bake_text.name)


def shot_for_moment(bake: Bake, moment: Moment, fps: float) -> Shot:
    """The baked shot as this frame of the scene wants it.

    Raises:
        ShotError: The frame lies outside the bake, or the scene asks for other actions, objects
            or pace than were baked.
    """
    shot, frame = bake.shot, moment.frame
    if frame not in shot.frames:
        raise ShotError(
            f"frame {frame} is outside the baked range {shot.frame_start} to {shot.frame_end}; "
            f"change the scene's range and {BAKE_AGAIN}"
        )
    if abs(fps - shot.fps) > 1e-6 * shot.fps:
        raise ShotError(f"the scene runs at {fps:g} fps, the bake at {shot.fps:g}; {BAKE_AGAIN}")
    _check_objects(shot, moment)
    cameras = _cameras(shot, moment)
    camera_moved = cameras[frame - shot.frame_start] is moment.camera
    tracks = tuple(
        _track(track, bake, moment.tracks[track.name], frame, camera_moved)
        for track in shot.objects
    )
    return dataclasses.replace(shot, cameras=cameras, objects=tracks)


def _check_objects(shot: Shot, moment: Moment) -> None:
    baked = {track.name for track in shot.objects}
    if baked != set(moment.tracks):
        raise ShotError(
            f"the bake knows the playable objects {sorted(baked)}, the scene has "
            f"{sorted(moment.tracks)}; {BAKE_AGAIN}"
        )
    for name, now in moment.tracks.items():
        then = shot.action_at(name, moment.frame)
        if now.action is not None and now.action != then:
            raise ShotError(
                f"the action keys of {name!r} have changed: action {now.action} at frame "
                f"{moment.frame}, baked with {then}; {BAKE_AGAIN}"
            )


def _cameras(shot: Shot, moment: Moment) -> tuple[Camera, ...]:
    """Baked cameras on the scene's pixel grid; the scene's own at this frame if it has moved."""
    width, height = moment.camera.width, moment.camera.height
    cameras = shot.cameras
    if (cameras[0].width, cameras[0].height) != (width, height):
        cameras = tuple(camera.scaled(width, height) for camera in cameras)
    index = moment.frame - shot.frame_start
    if _same_view(cameras[index], moment.camera):
        return cameras
    return (*cameras[:index], moment.camera, *cameras[index + 1 :])


def _same_view(a: Camera, b: Camera) -> bool:
    close = {"rtol": CAMERA_TOLERANCE, "atol": CAMERA_TOLERANCE}
    return bool(
        np.allclose(a.intrinsics, b.intrinsics, **close)
        and np.allclose(a.world_from_camera, b.world_from_camera, **close)
    )


def _track(
    track: ObjectTrack, bake: Bake, now: TrackMoment, frame: int, camera_moved: bool
) -> ObjectTrack:
    index = frame - bake.shot.frame_start
    visible = track.visible or (True,) * len(bake.shot.frames)
    if visible[index] != now.visible:
        visible = (*visible[:index], now.visible, *visible[index + 1 :])
        track = dataclasses.replace(track, visible=visible)
    # A moved camera would make the model predict another path, so the baked one is spelt out.
    return dataclasses.replace(
        track,
        locations=_locations(bake.paths[track.name], now, index, camera_moved),
        headings=_headings(bake, track.name, now, index, camera_moved),
    )


def _locations(
    path: np.ndarray, now: TrackMoment, index: int, spelt_out: bool
) -> tuple[tuple[float, float, float], ...] | None:
    if not spelt_out and np.abs(path[index] - now.location).max() <= MOVED_METRES:
        return None
    points = [tuple(float(x) for x in point) for point in path]
    points[index] = now.location
    return tuple(points)


def _headings(
    bake: Bake, name: str, now: TrackMoment, index: int, spelt_out: bool
) -> tuple[float, ...] | None:
    # Objects without a predicted heading keep the axes of the environment until they are turned.
    baked = bake.headings.get(name, np.zeros(len(bake.shot.frames)))
    turned = abs(math.remainder(now.heading - baked[index], math.tau)) > TURNED_RADIANS
    if not turned and not (spelt_out and name in bake.headings):
        return None
    headings = [float(heading) for heading in baked]
    if turned:
        headings[index] = now.heading
    return tuple(headings)
