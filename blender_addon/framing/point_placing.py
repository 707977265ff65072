"""Placing the points of the ground on a picture: what the mouse means, whoever holds it."""

import math
from collections.abc import Sequence

Pixel = tuple[float, float]


class PointPlacing:
    """Points that are set, dragged and taken away.

    Attributes:
        points: Per point its pixel; None while it has no place in the picture.
        active: Index of the point that is meant; the number of points for the next new one.

    Args:
        points: What there is.
        active: The point that a click sets first.
        size: Width and height of the picture; points stay in it.
    """

    def __init__(self, points: Sequence[Pixel | None], active: int, size: tuple[int, int]) -> None:
        self.points: list[Pixel | None] = list(points)
        self.active = min(max(active, 0), len(self.points))
        self._size = size
        self._held: int | None = None

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
        self.active = self._held
        if near is None:
            self.points[self._held] = self._kept_inside(u, v)

    def move(self, u: float, v: float) -> None:
        """Pull the point in the hand to a pixel."""
        if self._held is not None:
            self.points[self._held] = self._kept_inside(u, v)

    def release(self) -> None:
        """Let go; the next click sets the next point without a place."""
        self._held = None

    def remove(self) -> int | None:
        """Take the active point away; returns the index that it had."""
        if not 0 <= self.active < len(self.points):
            return None
        gone, self._held = self.active, None
        del self.points[gone]
        self.active = min(gone, len(self.points))
        return gone

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

    def _kept_inside(self, u: float, v: float) -> Pixel:
        width, height = self._size
        return min(max(u, 0.0), float(width)), min(max(v, 0.0), float(height))
