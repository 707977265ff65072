"""What the overlay shows, as numbers: coloured lines, dots and names in environment space.

Everything here and in the modules that make it is computed without Blender, so that tests can check
it against hand numbers; only `drawing` knows how it gets on the screen.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

Colour = tuple[float, float, float, float]
"""Red, green, blue, opacity in [0, 1], display-referred."""
NEUTRAL: Colour = (0.92, 0.94, 0.96, 0.9)
AMBER: Colour = (1.0, 0.66, 0.1, 1.0)
RED: Colour = (1.0, 0.26, 0.2, 1.0)
OF_OBJECTS: tuple[Colour, ...] = (
    (0.25, 0.72, 1.0, 1.0),
    (1.0, 0.48, 0.78, 1.0),
    (0.45, 0.9, 0.5, 1.0),
    (0.76, 0.6, 1.0, 1.0),
    (0.2, 0.86, 0.82, 1.0),
    (0.96, 0.9, 0.45, 1.0),
)
"""One after the other for the objects of a scene; none of them looks like a warning."""


@dataclass(frozen=True, eq=False)
class Strokes:
    """Line segments of one width.

    Attributes:
        ends: (segments, 2, 3) float64 metres.
        colours: (segments, 4) float64.
        width: Pixels of the screen, at a user interface scale of 1.
    """

    ends: np.ndarray
    colours: np.ndarray
    width: float = 1.0


@dataclass(frozen=True, eq=False)
class Dots:
    """Round marks of one size.

    Attributes:
        points: (dots, 3) float64 metres.
        colours: (dots, 4) float64.
        size: Pixels of the screen, at a user interface scale of 1.
    """

    points: np.ndarray
    colours: np.ndarray
    size: float = 5.0


@dataclass(frozen=True)
class Label:
    """Words beside a point.

    Attributes:
        anchor: The point, metres.
        text: One line, or several of them.
        colour: Of the words.
        rank: Where two labels meet, the one of the lower rank stays.
    """

    anchor: tuple[float, float, float]
    text: str
    colour: Colour = NEUTRAL
    rank: int = 0


@dataclass(frozen=True)
class SceneLines:
    """Everything that is drawn over a scene."""

    strokes: tuple[Strokes, ...] = ()
    dots: tuple[Dots, ...] = ()
    labels: tuple[Label, ...] = field(default=())

    def __add__(self, other: "SceneLines") -> "SceneLines":
        return SceneLines(
            self.strokes + other.strokes, self.dots + other.dots, self.labels + other.labels
        )

    @property
    def segments(self) -> int:
        """How many line segments there are."""
        return sum(len(each.ends) for each in self.strokes)


def joined(parts: Iterable[SceneLines]) -> SceneLines:
    """All parts, the first one drawn first."""
    return sum(parts, SceneLines())


def strokes(ends: np.ndarray, colour: Colour | np.ndarray, width: float = 1.0) -> SceneLines:
    """Line segments (segments, 2, 3) of one colour, or of a colour each (segments, 4)."""
    ends = np.asarray(ends, np.float64).reshape(-1, 2, 3)
    return SceneLines(strokes=(Strokes(ends, _spread(colour, len(ends)), width),))


def dots(points: np.ndarray, colour: Colour | np.ndarray, size: float = 5.0) -> SceneLines:
    """Marks at points (dots, 3) of one colour, or of a colour each (dots, 4)."""
    points = np.asarray(points, np.float64).reshape(-1, 3)
    return SceneLines(dots=(Dots(points, _spread(colour, len(points)), size),))


def label(anchor: np.ndarray, text: str, colour: Colour = NEUTRAL, rank: int = 0) -> SceneLines:
    """Words beside a point (3,)."""
    x, y, z = (float(each) for each in anchor)
    return SceneLines(labels=(Label((x, y, z), text, colour, rank),))


def faded(colour: Colour, opacity: float) -> Colour:
    """A colour with its opacity multiplied."""
    return (*colour[:3], colour[3] * opacity)


def _spread(colour: Colour | np.ndarray, count: int) -> np.ndarray:
    return np.broadcast_to(np.asarray(colour, np.float64), (count, 4)).copy()
