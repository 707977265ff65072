"""What the viewport wants, what is drawn for it, and what it shows meanwhile. No `bpy` here.

The newest view wins. While it moves it is drawn in few pixels; as soon as it rests it is drawn in
full, band by band, so that nobody has to wait long for the worker.
"""

import dataclasses
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pe_runtime.contract.shot import Region, Shot

from .resolution import Cost, Size, next_band, quick_size

STILL_SECONDS = 0.3
"""A view that has not moved for so long rests."""
PATIENCE_SECONDS = 1.0
"""A picture of a view that has moved on since may be finished for so long."""


@dataclass(frozen=True)
class Wish:
    """A frame as the viewport would show it.

    Attributes:
        take: One frame, seen by the view's camera in as many pixels as the view has.
        whole: The shot that it is a take of.
    """

    take: Shot
    whole: Shot

    @property
    def size(self) -> Size:
        """Width and height in pixels."""
        return self.take.size

    def same_scene(self, other: "Wish") -> bool:
        """Whether the other one differs in nothing but the view."""
        moved = dataclasses.replace(self.take, cameras=other.take.cameras)
        return self.whole is other.whole and moved == other.take


@dataclass(frozen=True)
class Job:
    """Something to draw.

    Attributes:
        number: Counts the wishes.
        wish: What is wanted.
        size: Pixels of the whole picture.
        band: The part of it that is drawn; None for all.
        began: When it was handed out, seconds.
    """

    number: int
    wish: Wish
    size: Size
    band: Region | None
    began: float

    @property
    def shot(self) -> Shot:
        """What the worker is asked for."""
        camera = self.wish.take.cameras[0].scaled(*self.size)
        return dataclasses.replace(self.wish.take, cameras=(camera,), region=self.band)


@dataclass(frozen=True)
class Shown:
    """A picture on show.

    Attributes:
        number: Of the wish that it was drawn for.
        rgb: (height, width, 3) uint8 sRGB, top row first; read only.
        rows_done: Rows from the top that have the full picture's pixels.
    """

    number: int
    rgb: np.ndarray
    rows_done: int = 0


class Desk:
    """One viewport's wishes and pictures; any thread may call.

    Args:
        clock: Seconds since some time.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._lock = clock, threading.Lock()
        self._wish: Wish | None = None
        self._number = 0
        self._changed_at = 0.0
        self._job: Job | None = None
        self._shown: Shown | None = None
        self._failure: tuple[Wish, str] | None = None
        self._cost = Cost()
        self._closed = False

    @property
    def shown(self) -> Shown | None:
        """The best picture that there is."""
        return self._shown

    @property
    def failure(self) -> str:
        """Why the wish cannot be fulfilled; empty where it can."""
        return self._failure[1] if self._failed() else ""

    @property
    def has_more(self) -> bool:
        """Whether the picture on show is not the last one of this wish."""
        with self._lock:
            if self._closed or self._wish is None or self._failed():
                return False
            return self._job is not None or not self._is_complete()

    def want(self, wish: Wish | None) -> None:
        """Say what the viewport would show now; the same again changes nothing."""
        with self._lock:
            if wish == self._wish:
                return
            self._wish = wish
            self._number += 1
            self._changed_at = self._clock()

    def take_job(self) -> Job | None:
        """The next thing to draw, if there is one now; its end has to be told."""
        with self._lock:
            wish = self._wish
            if self._closed or wish is None or self._job is not None or self._failed():
                return None
            plan = self._plan(wish)
            if plan is not None:
                self._job = Job(self._number, wish, *plan, self._clock())
            return self._job

    def is_outdated(self, job: Job) -> bool:
        """Whether a job is not worth its time any more."""
        if self._closed:
            return True
        if job.number == self._number:
            return False
        return job.band is not None or self._clock() - job.began > PATIENCE_SECONDS

    def deliver(self, job: Job, rgb: np.ndarray, seconds: float) -> None:
        """Hand in what was drawn and how long that took."""
        with self._lock:
            self._job = None
            self._cost.note((rgb.shape[1], rgb.shape[0]), seconds)
            shown = self._shown
            if shown is not None and job.number < shown.number:
                return
            if job.band is None:
                rows = rgb.shape[0] if job.size == job.wish.size else 0
                self._shown = Shown(job.number, rgb, rows)
            elif shown is not None:
                self._shown = _with_band(shown, job, rgb)

    def give_up(self, job: Job, reason: str = "") -> None:
        """Tell that a job was not done; with a reason it is not tried again for this scene."""
        with self._lock:
            self._job = None
            if reason:
                self._failure = job.wish, reason

    def close(self) -> None:
        """Want nothing any more."""
        self._closed = True

    def _failed(self) -> bool:
        failure, wish = self._failure, self._wish
        return failure is not None and wish is not None and wish.same_scene(failure[0])

    def _is_complete(self) -> bool:
        shown = self._shown
        return shown is not None and (shown.number, shown.rows_done) == (
            self._number,
            self._wish.size[1],
        )

    def _plan(self, wish: Wish) -> tuple[Size, Region | None] | None:
        """Size and part of the next picture."""
        shown, cost = self._shown, self._cost.seconds_per_pixel
        if shown is None or shown.number != self._number:
            return quick_size(wish.size, cost), None
        rests = self._clock() - self._changed_at >= STILL_SECONDS
        if self._is_complete() or not rests:
            return None
        return wish.size, next_band(wish.size, shown.rows_done, cost)


def _with_band(shown: Shown, job: Job, rgb: np.ndarray) -> Shown:
    """The picture on show with more rows of the full one; the rest of it is stretched."""
    (width, height), (_, top, _, rows) = job.size, job.band
    canvas = shown.rgb
    if canvas.shape[:2] != (height, width):
        across = np.arange(width) * canvas.shape[1] // width
        down = np.arange(height) * canvas.shape[0] // height
        canvas = canvas[down[:, None], across]
    else:
        canvas = canvas.copy()
    canvas[top : top + rows] = rgb
    return Shown(job.number, canvas, top + rows)
