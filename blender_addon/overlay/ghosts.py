"""The volumes of playable objects a few steps before and after now. Without Blender."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .foreseen_paths import Foresight, Path, colour_of, heading_at, position_at
from .scene_lines import Colour, SceneLines, faded, joined, label, strokes
from .volume_lines import head_of, heading_arrow, volume_edges

NEAREST, FARTHEST = 0.7, 0.25
"""Opacity of the ghost next to now and of the last one."""
PAST = 0.6
"""How much dimmer those before now are."""
APART, TURNED = 0.2, math.radians(12)
"""Share of an object's width, and angle, between ghosts: closer ones would only blur."""
USUAL_LENGTH = 0.6
"""Metres of the arrow of an object whose volume is unknown."""


@dataclass(frozen=True)
class Skins:
    """Which ghosts are shown.

    Attributes:
        before: How many behind the object.
        after: How many ahead of it.
        every: Steps of the model from one to the next.
    """

    before: int = 1
    after: int = 3
    every: int = 2


def ghost_frames(seen: Foresight, skins: Skins) -> list[tuple[float, float]]:
    """Scene frames of the ghosts, whole or not, each with its opacity; none at the frame of now.

    They stand at steps of the model: they move on when a step is over, not with every frame.
    """
    if not seen.length:
        return []
    stride = skins.every * seen.frames_per_step
    last = seen.frame_start + seen.length - 1
    step = (seen.now - seen.frame_start) / stride
    behind = [np.ceil(step - 1e-6) - k for k in range(1, skins.before + 1)]
    ahead = [np.floor(step + 1e-6) + k for k in range(1, skins.after + 1)]
    found = []
    for numbers, dim in ((behind, PAST), (ahead, 1.0)):
        opacities = np.linspace(NEAREST, FARTHEST, max(len(numbers), 2)) * dim
        frames = [float(seen.frame_start + number * stride) for number in numbers]
        pairs = zip(frames, opacities, strict=False)
        found += [(f, float(o)) for f, o in pairs if seen.frame_start <= f <= last + 1e-6]
    return sorted(found)


def present_lines(seen: Foresight) -> SceneLines:
    """The volume of every object where it is now, with its name."""
    return joined(
        strokes(_box(seen, each, seen.now), colour_of(i), 1.5)
        + label(head_of(each.volume, position_at(seen, each, seen.now)), each.name, colour_of(i), 4)
        for i, each in enumerate(seen.paths)
        if each.volume is not None and len(each.positions)
    )


def ghost_lines(seen: Foresight, skins: Skins) -> SceneLines:
    """Wire boxes where the objects were and will be."""
    frames = ghost_frames(seen, skins)
    return joined(
        _ghosts(seen, each, colour_of(i), frames)
        for i, each in enumerate(seen.paths)
        if each.volume is not None and len(each.positions)
    )


def heading_arrows(seen: Foresight) -> SceneLines:
    """An arrow from every object that turns, towards where it looks now."""
    return joined(
        strokes(_arrow(seen, each), colour_of(i), 2.5)
        for i, each in enumerate(seen.paths)
        if each.headings is not None and len(each.positions)
    )


def _ghosts(
    seen: Foresight, path: Path, colour: Colour, frames: list[tuple[float, float]]
) -> SceneLines:
    return joined(
        strokes(_box(seen, path, frame), faded(colour, opacity))
        for frame, opacity in _told_apart(seen, path, frames)
    )


def _box(seen: Foresight, path: Path, frame: float) -> np.ndarray:
    place, turn = position_at(seen, path, frame), heading_at(seen, path, frame)
    return volume_edges(path.volume, place, turn)


def _told_apart(
    seen: Foresight, path: Path, frames: list[tuple[float, float]]
) -> Iterator[tuple[float, float]]:
    """Those ghosts that stand visibly elsewhere than the object and the ghosts nearer to now."""
    low, high = path.volume.low, path.volume.high
    room = APART * min(high[0] - low[0], high[1] - low[1])
    now = position_at(seen, path, seen.now), heading_at(seen, path, seen.now)
    last = {True: now, False: now}
    for frame, opacity in sorted(frames, key=lambda each: abs(each[0] - seen.now)):
        ahead = frame > seen.now
        there, facing = position_at(seen, path, frame), heading_at(seen, path, frame)
        if math.dist(last[ahead][0], there) > room or abs(last[ahead][1] - facing) > TURNED:
            last[ahead] = there, facing
            yield frame, opacity


def _arrow(seen: Foresight, path: Path) -> np.ndarray:
    length = USUAL_LENGTH
    if path.volume is not None:
        length = 0.5 * (path.volume.high[2] - path.volume.low[2])
    here = position_at(seen, path, float(seen.now))
    return heading_arrow(here, heading_at(seen, path, seen.now), length)
