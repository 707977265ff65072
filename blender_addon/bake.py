"""The baked shot: what the worker predicted paths for, kept in the .blend and filmed later.

A frame is rendered from the baked shot, changed only where the artist has since moved the camera,
or overridden an Empty's place, heading, visibility, style or pose, at that frame. Other changes ask
for another bake.
"""

import dataclasses
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import PurePath

import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.shot import ObjectTrack, PoseKey, Shot, Start, StyleMix

from .json_text import json_text
from .overrides.reading import Override
from .scene_bridge import Moment, TrackMoment
from .state_files import is_content_name, picture_in, portable, state_file, stored_state

PICTURE_FORMAT, FORMAT = 1, 2
"""Bakes that start from a picture, and those that start from a state."""
BAKE_AGAIN = "press Bake Paths again"
# Locations pass through float32 F-curves and the root's matrix: below this nobody has moved it.
MOVED_METRES = 1e-4
TURNED_RADIANS = 1e-4
CAMERA_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Sources:
    """Where the state of a .blend's environment lies on this machine.

    Attributes:
        file: Path of its state file; empty where there is none.
        text: What it was made from and became, as JSON.
    """

    file: str = ""
    text: str = ""


NO_SOURCES = Sources()


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

    @property
    def digest(self) -> str:
        """SHA-256 of the shot, in hex; the same on every machine."""
        return portable(self.shot).digest()

    def to_json(self) -> str:
        """The bake as the text of a Blender text block."""
        shot = portable(self.shot)
        paths = {name: np.asarray(path).tolist() for name, path in self.paths.items()}
        headings = {name: np.asarray(each).tolist() for name, each in self.headings.items()}
        content = {
            "format": FORMAT,
            "digest": shot.digest(),
            "shot": shot.as_dict(),
            "paths": paths,
            "headings": headings,
        }
        return json_text(content)


@lru_cache(maxsize=4)
def read_bake(text: str, where: str, sources: Sources = NO_SOURCES) -> Bake:
    """Read what `Bake.to_json` wrote; remembered, since every frame asks.

    Args:
        text: The bake.
        where: Its name, for errors.
        sources: Where the states that it names lie now.

    Raises:
        ShotError: The text is no bake, was changed by hand, or names a state that is gone.
    """
    try:
        content = json.loads(text)
        stored, digest, made_as = content["shot"], content["digest"], content["format"]
        paths = {name: np.array(path, np.float64) for name, path in content["paths"].items()}
        # Bakes from before there were headings have none.
        headings = content.get("headings", {}).items()
        headings = {name: np.array(each, np.float64) for name, each in headings}
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ShotError(f"{where!r} is no bake ({error!r}); {BAKE_AGAIN}") from error
    if made_as not in (PICTURE_FORMAT, FORMAT):
        raise ShotError(
            f"{where!r} is a bake of format {made_as}, this add-on reads up to {FORMAT}; update "
            f"the add-on, or {BAKE_AGAIN}"
        )
    shot = Shot.from_dict(stored, where)
    if shot.digest() != digest:
        raise ShotError(f"{where!r} was edited since it was baked; {BAKE_AGAIN}")
    return Bake(_found(shot, sources, where), paths, headings)


def bake_of(settings: object) -> Bake:
    """The bake that a scene's settings hold; the state that it starts from is there as a file.

    Raises:
        ShotError: Nothing was baked yet.
    """
    if settings.root is None:
        raise ShotError("this scene has no environment; make one with New Playable Environment")
    if text := settings.of_newer_addon():
        raise ShotError(text)
    if settings.bake_text is None:
        raise ShotError("nothing is baked yet; press Bake Paths before rendering")
    # Every time: whoever empties the temporary folder does not ask.
    sources = _sources_of(settings.state_text)
    return read_bake(settings.bake_text.as_string(), settings.bake_text.name, sources)


def _sources_of(block: object) -> Sources:
    """The state of an environment's text block as a file, if there is such a block."""
    if block is None:
        return NO_SOURCES
    text = block.as_string()
    return Sources(str(state_file(stored_state(text, block.name))), text)


def _found(shot: Shot, sources: Sources, where: str) -> Shot:
    """The shot with its start where it lies now."""
    start = shot.start
    if start.state is None:
        # Baked before states became files: the picture may be gone, its state is here.
        same = sources.file and picture_in(sources.text, where).as_dict() == start.as_dict()
        return dataclasses.replace(shot, start=Start(state=sources.file)) if same else shot
    if not is_content_name(start.state):
        return shot
    if not sources.file:
        raise ShotError(
            "the encoded picture of this environment is no longer in this file; undo its deletion, "
            "or press New Playable Environment"
        )
    if PurePath(sources.file).name != start.state:
        raise ShotError(
            f"{where!r} starts from a state that is no longer in this file; {BAKE_AGAIN}"
        )
    return dataclasses.replace(shot, start=Start(state=sources.file))


@dataclass(frozen=True)
class Output:
    """What is wanted of a frame, whatever it shows.

    Attributes:
        width: Columns.
        height: Rows.
        quality: The Shot's quality.
        passes: The Shot's passes.
    """

    width: int
    height: int
    quality: str = "exact"
    passes: tuple[str, ...] = ()


def take_of_moment(bake: Bake, moment: Moment, fps: float, output: Output) -> Shot:
    """One frame of the baked shot, as the scene wants it.

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
    camera = camera_of_moment(bake, moment, output)
    tracks = tuple(
        _track(track, bake, moment.tracks[track.name], frame - shot.frame_start)
        for track in shot.objects
    )
    return _take(shot, frame, camera, tracks, output)


def is_as_baked(bake: Bake, take: Shot, output: Output) -> bool:
    """Whether a take of one frame shows what was baked: same camera, no overrides of any kind."""
    return take == take_as_baked(bake, take.frame_start, output)


def take_as_baked(bake: Bake, frame: int, output: Output) -> Shot:
    """One frame of the baked shot, with nothing changed since; `frame` is a baked one."""
    index = frame - bake.shot.frame_start
    tracks = tuple(
        _still(track, track.visible is None or track.visible[index]) for track in bake.shot.objects
    )
    return _take(bake.shot, frame, _baked_camera(bake, frame, output), tracks, output)


def camera_of_moment(bake: Bake, moment: Moment, output: Output) -> Camera:
    """The camera of a frame: the baked one, unless the scene's has moved by more than rounding."""
    baked, now = _baked_camera(bake, moment.frame, output), moment.camera
    if _same_view(baked, now):
        return baked
    if not is_turned(baked, now):
        # The very axes that were baked: an exported shot predicts by the camera that it films with.
        pose = now.world_from_camera.copy()
        pose[:3, :3] = baked.world_from_camera[:3, :3]
        return dataclasses.replace(now, world_from_camera=pose)
    return now


def is_turned(a: Camera, b: Camera) -> bool:
    """Whether two cameras look in other directions, or are rolled."""
    axes = a.world_from_camera[:3, :3] - b.world_from_camera[:3, :3]
    return bool(np.abs(axes).max() > CAMERA_TOLERANCE)


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


def _take(
    shot: Shot, frame: int, camera: Camera, tracks: tuple[ObjectTrack, ...], output: Output
) -> Shot:
    return dataclasses.replace(
        shot,
        frame_start=frame,
        frame_end=frame,
        cameras=(camera,),
        objects=tracks,
        quality=output.quality,
        passes=output.passes,
    )


def _baked_camera(bake: Bake, frame: int, output: Output) -> Camera:
    """The baked camera on the pixel grid that is wanted now."""
    camera = bake.shot.camera_at(frame)
    if (camera.width, camera.height) == (output.width, output.height):
        return camera
    return camera.scaled(output.width, output.height)


def _same_view(a: Camera, b: Camera) -> bool:
    close = {"rtol": CAMERA_TOLERANCE, "atol": CAMERA_TOLERANCE}
    return bool(
        np.allclose(a.intrinsics, b.intrinsics, **close)
        and np.allclose(a.world_from_camera, b.world_from_camera, **close)
    )


def _still(track: ObjectTrack, visible: bool) -> ObjectTrack:
    """One frame of a track, standing where it is predicted; actions count in the whole only."""
    return ObjectTrack(track.name, visible=None if visible else (False,), styles=track.styles)


def _track(track: ObjectTrack, bake: Bake, now: TrackMoment, index: int) -> ObjectTrack:
    frame, override = bake.shot.frame_start + index, now.override
    moved = np.abs(bake.paths[track.name][index] - now.location).max() > MOVED_METRES
    # Objects without a predicted heading keep the axes of the environment until they are turned.
    baked = float(bake.headings[track.name][index]) if track.name in bake.headings else 0.0
    has_turned = abs(math.remainder(now.heading - baked, math.tau)) > TURNED_RADIANS
    still = _still(track, now.visible)
    held = held_frame(bake.shot, override)
    return dataclasses.replace(
        still,
        locations=(now.location,) if moved else None,
        headings=(now.heading,) if has_turned else None,
        styles=style_mixes(frame, override) or still.styles,
        # In the frame where holding begins the pose is the predicted one.
        poses=() if held in (None, frame) else (PoseKey(frame, held),),
    )


def style_mixes(frame: int, override: Override) -> tuple[StyleMix, ...]:
    """The style that an override gives an object from a frame on; none where it is its own."""
    lent = override.style
    return () if lent is None else (StyleMix(frame, lent.file, lent.object, lent.weight),)


def held_frame(shot: Shot, override: Override) -> int | None:
    """The frame whose pose an override holds; None where the pose is free."""
    if override.held_since is None:
        return None
    # Holding that began before the shot keeps the first pose that there is.
    return max(override.held_since, shot.frame_start)
