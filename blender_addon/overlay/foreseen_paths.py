"""Where playable objects are going, before anything is rendered. Without Blender."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pe_runtime.contract.model_facts import Volume

from .scene_lines import OF_OBJECTS, Colour, SceneLines, dots, faded, joined, label, strokes

PAST = 0.35
"""Opacity of what lies before the current frame."""
MOST_MARKS = 400
"""Step marks of one object; a longer shot marks every second step, and so on."""
STILL_METRES = 0.02
"""Action names closer together than this would be written over one another."""


@dataclass(frozen=True, eq=False)
class Path:
    """One object's way through the shot.

    Attributes:
        name: The playable object's.
        positions: (frames, 3) metres, environment space.
        headings: (frames,) radians; None where it keeps the environment's axes.
        keys: Frames from which an action is done, with its name.
        volume: The object's, if known.
    """

    name: str
    positions: np.ndarray
    headings: np.ndarray | None = None
    keys: Sequence[tuple[int, str]] = ()
    volume: Volume | None = None


@dataclass(frozen=True, eq=False)
class Foresight:
    """The paths of a shot and the frame that is looked at.

    Attributes:
        paths: Of the playable objects, in the model's order.
        frame_start: Scene frame of the first position.
        now: The current scene frame; may lie outside.
        frames_per_step: Scene frames that one step of the model takes.
    """

    paths: tuple[Path, ...]
    frame_start: int
    now: int
    frames_per_step: float

    @property
    def length(self) -> int:
        """Frames of the shot."""
        return min((len(each.positions) for each in self.paths), default=0)


def colour_of(index: int) -> Colour:
    """The colour of the object at a place in the model's order."""
    return OF_OBJECTS[index % len(OF_OBJECTS)]


def path_lines(seen: Foresight) -> SceneLines:
    """Every path as a line, dimmer where it is past, with a mark where the object is now."""
    return joined(_path(seen, each, colour_of(i)) for i, each in enumerate(seen.paths))


def step_marks(seen: Foresight) -> SceneLines:
    """A small dot wherever a step of the model ends."""
    frames = step_frames(seen)
    return joined(
        dots(position_at(seen, each, frames), _by_time(seen, frames, colour_of(i)), 4.0)
        for i, each in enumerate(seen.paths)
    )


def action_labels(seen: Foresight) -> SceneLines:
    """The names of actions where they begin to be done."""
    return joined(_actions(seen, each, colour_of(i)) for i, each in enumerate(seen.paths))


def step_frames(seen: Foresight) -> np.ndarray:
    """Scene frames, whole or not, at which steps of the model begin."""
    count = math.floor((seen.length - 1) / seen.frames_per_step + 1e-6) + 1 if seen.length else 0
    every = max(1, math.ceil(count / MOST_MARKS))
    return seen.frame_start + np.arange(0, count, every) * seen.frames_per_step


def position_at(seen: Foresight, path: Path, frames: np.ndarray | float) -> np.ndarray:
    """Positions (..., 3) of a path at scene frames (...,), whole or not, clamped to its ends."""
    times = seen.frame_start + np.arange(len(path.positions))
    return np.stack([np.interp(frames, times, axis) for axis in path.positions.T], axis=-1)


def heading_at(seen: Foresight, path: Path, frame: float) -> float:
    """Heading at a scene frame, the shorter way round between frames."""
    if path.headings is None:
        return 0.0
    times = seen.frame_start + np.arange(len(path.headings))
    return float(np.interp(frame, times, np.unwrap(path.headings)))


def _path(seen: Foresight, path: Path, colour: Colour) -> SceneLines:
    points = np.asarray(path.positions, np.float64)
    ends = np.stack([points[:-1], points[1:]], axis=1)
    middles = seen.frame_start + 0.5 + np.arange(len(ends))
    line = strokes(ends, _by_time(seen, middles, colour), 2.5)
    return line + dots(position_at(seen, path, seen.now), colour, 10.0)


def _by_time(seen: Foresight, frames: np.ndarray, colour: Colour) -> np.ndarray:
    """(frames, 4) a colour, dimmer for frames that are past."""
    opacity = np.where(frames < seen.now, PAST, 1.0)
    colours = np.tile(np.array(colour), (len(frames), 1))
    colours[:, 3] *= opacity
    return colours


def _actions(seen: Foresight, path: Path, colour: Colour) -> SceneLines:
    parts, last = [], None
    for frame, action in path.keys:
        inside = 0 <= frame - seen.frame_start < len(path.positions)
        if not inside:
            continue
        at = position_at(seen, path, frame)
        tint = faded(colour, PAST) if frame < seen.now else colour
        parts.append(dots(at, tint, 8.0))
        # The later one of two names at one spot is the one that moves the object on.
        if last is not None and np.linalg.norm(at - last) < STILL_METRES:
            parts.pop(-2)
        parts.append(label(at, action, tint, 3))
        last = at
    return joined(parts)
