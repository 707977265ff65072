"""Placing the points of the ground on a picture: what the mouse means, whoever holds it."""

import math
from collections.abc import Sequence

from .box_limits import nearest_inside

Pixel = tuple[float, float]


class PointPlacing:
    """Points that are set, dragged and taken away.

    Attributes:
        points: Per point its pixel; None while it has no place in the picture.
        active: Index of the point that is meant; the number of points for the next new one.
        sources: Per point which of the points at the start it is; None: a new one.
        finished: Never by itself: there can always be one more point.

    Args:
        points: What there is.
        active: The point that a click sets first.
        size: Width and height of the picture; points stay in it.
    """

    def __init__(self, points: Sequence[Pixel | None], active: int, size: tuple[int, int]) -> None:
        self.points: list[Pixel | None] = list(points)
        self.active = min(max(active, 0), len(self.points))
        self.sources: list[int | None] = list(range(len(self.points)))
        self.finished = False
        self._size = size
        self._held: int | None = None
        self._before: Pixel | None = None

    @property
    def dragging(self) -> bool:
        """Whether a point is in the hand."""
        return self._held is not None

    def press(self, u: float, v: float, reach: float) -> None:
        """Take the point within reach (pixels), or set one that has no place yet, or a new one."""
        near = self.nearest(u, v, reach)
        self._held = self._next_to_set() if near is None else near
        if self._held == len(self.points):
            self.points.append(None)
            self.sources.append(None)
        self.active, self._before = self._held, self.points[self._held]
        if near is None:
            self.points[self._held] = nearest_inside(u, v, self._size)

    def move(self, u: float, v: float) -> None:
        """Pull the point in the hand to a pixel."""
        if self._held is not None:
            self.points[self._held] = nearest_inside(u, v, self._size)

    def release(self, u: float, v: float) -> None:
        """Let the point stand; the next click sets the next point without a place."""
        self.move(u, v)
        self._held = None

    def let_go(self) -> None:
        """Put the point in the hand back; one that had no place has none again."""
        if self._held is not None:
            self.points[self._held], self._held = self._before, None

    def advance(self) -> None:
        """Mean the next point; after the last one, a new one."""
        self.let_go()
        self.active = (self.active + 1) % (len(self.points) + 1)

    def remove(self) -> None:
        """Take the active point away."""
        self.let_go()
        if self.active < len(self.points):
            del self.points[self.active], self.sources[self.active]

    def nearest(self, u: float, v: float, reach: float) -> int | None:
        """The point nearest to a pixel, no farther than `reach`."""
        apart = {i: math.dist(p, (u, v)) for i, p in enumerate(self.points) if p is not None}
        index = min(apart, key=apart.get, default=None)
        return index if index is not None and apart[index] <= reach else None

    def _next_to_set(self) -> int:
        if self.active < len(self.points) and self.points[self.active] is None:
            return self.active
        unset = [index for index, point in enumerate(self.points) if point is None]
        return unset[0] if unset else len(self.points)
