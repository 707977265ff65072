"""Which actions lead from picture to picture of a clip, and the keys that say so. No `bpy` here."""

import copy
import queue
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ShotError

from ..worker.replies import WorkerCancelledError
from ..worker.worker_client import OnProgress, ShouldStop

MOST_GAPS = 0.25
"""Share of the pictures in which an object may be missing; it is put between its neighbours."""
WAIT_SECONDS = 0.05
PICTURES_AHEAD = 2
Box = tuple[float, float, float, float]
State = Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class ClipFrame:
    """One picture of a clip, at a step of the model.

    Attributes:
        frame: Scene frame.
        pixels: (height, width, 3) uint8 sRGB, top row first.
        camera: What saw it, environment space, on its pixel grid.
        boxes: Of the objects seen, by name; None where they are still to be found.
    """

    frame: int
    pixels: np.ndarray
    camera: Camera
    boxes: Mapping[str, Box] | None


@dataclass(frozen=True)
class ReadActions:
    """What a clip shows.

    Attributes:
        keys: By object (frame, action), only where the action changes.
        filled: By object in how many pictures it was not seen.
    """

    keys: Mapping[str, Sequence[tuple[int, int]]]
    filled: Mapping[str, int]


class Observer(Protocol):
    """Who looks at the pictures: the worker, or a test."""

    def detect(self, pixels: np.ndarray, should_stop: ShouldStop) -> Mapping[str, Box]:
        """Boxes of the objects in a picture."""

    def encode(self, seen: ClipFrame, boxes: Mapping[str, Box], should_stop: ShouldStop) -> State:
        """The state that a picture shows."""

    def infer(
        self, states: Sequence[State], cameras: Sequence[Camera], should_stop: ShouldStop
    ) -> Mapping[str, Sequence[int]]:
        """By object the actions that lead from each state to the next."""


def step_frames(start: int, end: int, frames_per_step: float) -> list[int]:
    """The scene frames of a range at which the model takes its steps."""
    count = int((end - start) / frames_per_step + 1e-6) + 1
    return [start + int(step * frames_per_step + 1e-6) for step in range(count)]


def read_actions(
    pictures: Iterable[ClipFrame],
    names: Sequence[str],
    observer: Observer,
    should_stop: ShouldStop,
    on_progress: OnProgress,
    expected: int,
) -> ReadActions:
    """Look at a clip, picture by picture, and say what its objects do.

    Args:
        pictures: One for each step of the model, in order.
        names: The objects that are asked for.
        observer: Who looks at them.
        should_stop: Asked between pictures.
        on_progress: Told how far it is.
        expected: How many pictures there are.

    Raises:
        ShotError: There are fewer than two, or an object is hardly ever seen.
        WorkerCancelledError: `should_stop` said so.
    """
    frames, cameras, states, seen = [], [], [], []
    for picture in pictures:
        if should_stop():
            raise WorkerCancelledError("reading the clip was cancelled")
        on_progress("looking at the pictures", len(frames), expected + 1)
        boxes = picture.boxes
        if boxes is None:
            boxes = observer.detect(picture.pixels, should_stop)
        states.append(observer.encode(picture, boxes, should_stop))
        frames.append(picture.frame)
        cameras.append(picture.camera)
        seen.append({name for name in names if name in boxes})
    if len(frames) < 2:
        raise ShotError("the range holds no whole step of the model; make it longer")
    filled = {name: _fill(states, [name in each for each in seen], name) for name in names}
    on_progress("finding the actions", expected, expected + 1)
    found = observer.infer(states, cameras, should_stop)
    keys = {name: _changes(frames, found[name]) for name in names if name in found}
    return ReadActions(keys, {name: count for name, count in filled.items() if count})


class PictureFeed:
    """Hands pictures from the thread that can read them to the one that looks at them."""

    def __init__(self) -> None:
        self._waiting: queue.Queue = queue.Queue(PICTURES_AHEAD)

    @property
    def has_room(self) -> bool:
        """Whether another picture is wanted already."""
        return not self._waiting.full()

    def give(self, item: ClipFrame | Exception | None) -> None:
        """The next picture, why there is none, or None after the last."""
        self._waiting.put(item)

    def pictures(self, should_stop: ShouldStop) -> Iterator[ClipFrame]:
        """The pictures as they come.

        Raises:
            WorkerCancelledError: `should_stop` said so while waiting.
        """
        while True:
            try:
                item = self._waiting.get(timeout=WAIT_SECONDS)
            except queue.Empty:
                if should_stop():
                    raise WorkerCancelledError("reading the clip was cancelled") from None
                continue
            if item is None:
                return
            if isinstance(item, Exception):
                raise item
            yield item


def _fill(states: list[State], seen: Sequence[bool], name: str) -> int:
    """Put an object, where it is not seen, between where it is; how often that was."""
    at = np.flatnonzero(seen)
    missing = len(seen) - len(at)
    if missing > MOST_GAPS * len(seen):
        raise ShotError(
            f"{name!r} is seen in {len(at)} of {len(seen)} pictures only; track it in more of "
            "them, or shorten the range"
        )
    for index in np.flatnonzero(~np.array(seen)):
        nearest = int(at[np.abs(at - index).argmin()])
        found = copy.deepcopy(dict(states[nearest]["objects"][name]))
        places = np.array([states[i]["objects"][name]["position"] for i in at], np.float64)
        found["position"] = [float(np.interp(index, at, axis)) for axis in places.T]
        objects = dict(states[index]["objects"]) | {name: found}
        states[index] = dict(states[index]) | {"objects": objects}
    return missing


def _changes(frames: Sequence[int], actions: Sequence[int]) -> list[tuple[int, int]]:
    """(frame, action) wherever another action begins."""
    keys: list[tuple[int, int]] = []
    for frame, action in zip(frames, actions, strict=False):
        if not keys or keys[-1][1] != action:
            keys.append((frame, int(action)))
    return keys
