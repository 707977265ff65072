"""Drawing one box after the other on a picture: what the mouse means, whoever holds it."""

from collections.abc import Mapping, Sequence

from .box_limits import LEAST, Box, nearest_inside

CLICK = 2.0
"""Pixels of the picture below which a drag was a click and draws nothing."""


class BoxDrawing:
    """Rectangles dragged for a list of objects, each followed by the next object's.

    Attributes:
        boxes: What there is so far, the rectangle in the hand included.
        finished: Whether every object in turn has had its box.

    Args:
        names: The objects, in the order in which they are drawn.
        boxes: What was there before; drawn over, or kept.
        size: Width and height of the picture; rectangles end at its border.
    """

    def __init__(
        self, names: Sequence[str], boxes: Mapping[str, Box], size: tuple[int, int]
    ) -> None:
        self.boxes: dict[str, Box] = dict(boxes)
        self.finished = not names
        self._names, self._at, self._size = list(names), 0, size
        self._corner: tuple[float, float] | None = None
        self._before: Box | None = None

    @property
    def current(self) -> str:
        """The object whose box comes next; empty when finished."""
        return "" if self.finished else self._names[self._at]

    @property
    def dragging(self) -> bool:
        """Whether a rectangle is being drawn."""
        return self._corner is not None

    def press(self, u: float, v: float, _reach: float = 0.0) -> None:
        """Begin a rectangle at a pixel."""
        if not self.finished:
            self._corner, self._before = (
                nearest_inside(u, v, self._size),
                self.boxes.get(self.current),
            )

    def move(self, u: float, v: float) -> None:
        """Pull the rectangle to a pixel."""
        if self._corner is not None:
            (left, top), (right, bottom) = self._corner, nearest_inside(u, v, self._size)
            (left, right), (top, bottom) = sorted((left, right)), sorted((top, bottom))
            if right - left >= max(CLICK, LEAST) and bottom - top >= max(CLICK, LEAST):
                self.boxes[self.current] = left, top, right, bottom
            else:
                self._put_back()

    def release(self, u: float, v: float) -> None:
        """Let the rectangle stand and go on to the next object; a mere click changes nothing."""
        if self._corner is None:
            return
        self.move(u, v)
        self._corner = None
        if self.boxes.get(self.current) != self._before:
            self.advance()

    def let_go(self) -> None:
        """Drop the rectangle in the hand; the box from before is back."""
        if self._corner is not None:
            self._put_back()
            self._corner = None

    def advance(self) -> None:
        """Leave the object's box as it is and go on."""
        self.let_go()
        self._at += 1
        self.finished = self._at >= len(self._names)

    def remove(self) -> None:
        """The object is not in the picture: take its box away and go on."""
        self.let_go()
        self.boxes.pop(self.current, None)
        self.advance()

    def _put_back(self) -> None:
        if self._before is None:
            self.boxes.pop(self.current, None)
        else:
            self.boxes[self.current] = self._before
