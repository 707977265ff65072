"""What people see of a frame while the engine waits for it, and whether they have pressed Esc."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from .pace import Pace, duration_in_words, seconds_left, share_done


class ProgressBar(Protocol):
    """The part of Blender's engine that shows progress and listens for Esc."""

    def test_break(self) -> bool:
        """Whether the render was stopped."""

    def update_progress(self, progress: float) -> None:
        """Show a share that is done."""

    def update_stats(self, stats: str, info: str) -> None:
        """Show words."""


@dataclass(frozen=True)
class Place:
    """Where a frame stands in the job that it belongs to.

    Attributes:
        kind: Frames of one kind take about the same time.
        done: Frames of the job that came before.
        total: Frames of the job.
    """

    kind: tuple
    done: int = 0
    total: int = 1


def place_in_range(kind: tuple, frame: int, frames: range, is_animation: bool) -> Place:
    """The place of a scene's frame; a still is a job of its own."""
    if not is_animation or frame not in frames:
        return Place(kind)
    return Place(kind, frames.index(frame), len(frames))


class FrameWatch:
    """Asked again and again while a frame is awaited; called, it says whether to stop.

    Args:
        bar: Where progress is shown.
        place: Of the frame.
        pace: What earlier frames took.
        doing: Tells in words what the worker does, empty while it draws.
    """

    def __init__(
        self, bar: ProgressBar, place: Place, pace: Pace, doing: Callable[[], str]
    ) -> None:
        self._bar, self._place, self._pace, self._doing = bar, place, pace, doing
        self._durations = pace.of(place.kind)
        self._began = time.monotonic()
        self._waited_for_more = False
        self._shown = ""

    def __call__(self) -> bool:
        doing, now = self._doing(), time.monotonic()
        if doing:  # the clock of the frame starts when it is drawn
            self._began, self._waited_for_more = now, True
        self.show(doing, now - self._began)
        return self._bar.test_break()

    def show(self, doing: str, seconds: float) -> None:
        """Show what is done and how far it is, `seconds` into drawing."""
        place, durations = self._place, self._durations
        share = (place.done + share_done(durations, seconds)) / place.total
        self._bar.update_progress(share)
        words = _words(place, doing, seconds_left(durations, place.total - place.done, seconds))
        if words != self._shown:
            self._shown = words
            self._bar.update_stats("", words)

    def finish(self) -> None:
        """Remember how long the frame took, if all of the time was its own."""
        place = self._place
        if not self._waited_for_more:
            self._pace.note(place.kind, self._began, time.monotonic(), follows=place.done > 0)
        self._bar.update_progress((place.done + 1) / place.total)


def _words(place: Place, doing: str, left: float | None) -> str:
    words = [doing or "Drawing"]
    if place.total > 1:
        words.append(f"frame {place.done + 1} of {place.total}")
    if left is not None:
        words.append(f"about {duration_in_words(left)} left")
    return " · ".join(words)
