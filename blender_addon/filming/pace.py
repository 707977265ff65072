"""How long frames take, and how long the rest of a range will; no `bpy` here."""

import math
from collections import deque
from collections.abc import Hashable, Sequence

REMEMBERED = 20
"""Frames that a running mean looks back on."""
KINDS = 32
SAVING_SECONDS = 60.0
"""A longer pause between two frames was made by somebody."""
MINUTE, HOUR = 60, 3600


class Pace:
    """Seconds that the last frames of every kind have taken."""

    def __init__(self) -> None:
        self._seconds: dict[Hashable, deque[float]] = {}
        self._last: tuple[Hashable, float] = None, -math.inf

    def note(self, kind: Hashable, began: float, ended: float, follows: bool = False) -> None:
        """Remember how long a frame of a kind has taken.

        Args:
            kind: Frames of one kind take about the same time.
            began: When it was asked for, seconds on any clock.
            ended: When it was there.
            follows: Whether it comes after another frame of the same job: then the time for which
                that one was saved counts too.
        """
        last_kind, last_ended = self._last
        if follows and last_kind == kind and began - last_ended < SAVING_SECONDS:
            began = last_ended
        self._last = kind, ended
        self._seconds.setdefault(kind, deque(maxlen=REMEMBERED)).append(ended - began)
        while len(self._seconds) > KINDS:
            del self._seconds[next(iter(self._seconds))]

    def of(self, kind: Hashable) -> tuple[float, ...]:
        """What is remembered of a kind, oldest first."""
        return tuple(self._seconds.get(kind, ()))


pace = Pace()
"""Of this Blender: engines come and go with every frame."""


def seconds_left(durations: Sequence[float], frames: int, into_this: float = 0.0) -> float | None:
    """How long some frames will take, by the mean of those before.

    Args:
        durations: Seconds of frames before.
        frames: How many are left, the one that is being drawn among them.
        into_this: Seconds that have gone into that one already.

    Returns:
        Seconds; None where there is nothing to go by.
    """
    if not durations or frames < 1:
        return None
    mean = sum(durations) / len(durations)
    return mean * (frames - 1) + max(mean - into_this, 0.0)


def share_done(durations: Sequence[float], into_this: float) -> float:
    """Which part of the frame that is being drawn is likely done, 0 to 1; 0 where nobody knows."""
    if not durations:
        return 0.0
    return min(into_this / max(sum(durations) / len(durations), 1e-6), 1.0)


def duration_in_words(seconds: float) -> str:
    """A duration as one says it: exact to what matters, and never shorter than it is."""
    if seconds < MINUTE:
        return f"{max(math.ceil(seconds), 1)} s"
    if seconds < HOUR:
        return f"{math.ceil(seconds / MINUTE)} min"
    minutes = math.ceil(seconds / MINUTE)
    return f"{minutes // 60} h {minutes % 60:02d} min"
