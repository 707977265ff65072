"""What a model was trained on, as ranges: outside of them it has never seen anything."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

Span = tuple[float, float]
"""Lowest and highest value."""
ENVELOPE_KEY = "envelope"
"""Of a model file's header."""
Corner = tuple[float, float]
"""x and y."""


@dataclass(frozen=True)
class Envelope:
    """Ranges of the training data; environment space, metres, degrees.

    Raises:
        ValueError: A range is not finite or ends before it begins.
    """

    positions: tuple[Corner, Corner]
    """Lowest and highest (x, y) at which players stood."""
    camera_heights: Span
    """Of the camera above the ground, metres."""
    camera_distances: Span
    """From the camera to the middle of the players, metres."""
    camera_pitches: Span
    """Of the camera's view above the horizon, degrees; negative looks down."""
    fields_of_view: Span
    """Horizontal, degrees."""
    box_heights: Span
    """Of players in the picture, as a share of its height."""

    def __post_init__(self) -> None:
        for name, low, high in self._spans():
            if not (math.isfinite(low) and math.isfinite(high) and low <= high):
                raise ValueError(f"envelope {name} is {low} to {high}; expected a finite range")

    def _spans(self) -> Iterator[tuple[str, float, float]]:
        for axis, low, high in zip("xy", *self.positions, strict=True):
            yield f"positions {axis}", low, high
        for name in (each.name for each in fields(self) if each.name != "positions"):
            yield name, *getattr(self, name)

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers and lists, ready for JSON."""
        spans = {each.name: list(getattr(self, each.name)) for each in fields(self)}
        return spans | {"positions": [list(corner) for corner in self.positions]}

    @staticmethod
    def from_dict(content: Any) -> "Envelope":  # noqa: ANN401 a JSON value
        """Read what `as_dict` wrote.

        Raises:
            KeyError, TypeError, ValueError: It is no envelope.
        """
        low, high = content["positions"]
        names = (each.name for each in fields(Envelope) if each.name != "positions")
        return Envelope((_span(low), _span(high)), *(_span(content[name]) for name in names))


def _span(pair: Any) -> Span:  # noqa: ANN401 a JSON value
    low, high = pair
    return float(low), float(high)
