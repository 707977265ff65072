"""Which names are written where, so that none lies over another. Without Blender."""

from collections.abc import Sequence
from dataclasses import dataclass

PADDING = 3
"""Pixels around the words."""


@dataclass(frozen=True)
class Words:
    """A label as it would be written on the screen; x to the right, y up, pixels.

    Attributes:
        left: Of its first letter.
        bottom: Of its last line.
        width: Of its longest line.
        height: Of all its lines.
        rank: The lower one of two that meet stays.
    """

    left: float
    bottom: float
    width: float
    height: float
    rank: int = 0

    def meets(self, other: "Words") -> bool:
        """Whether two labels would lie over each other."""
        apart = 2 * PADDING
        return (
            self.left < other.left + other.width + apart
            and other.left < self.left + self.width + apart
            and self.bottom < other.bottom + other.height + apart
            and other.bottom < self.bottom + self.height + apart
        )


def readable(labels: Sequence[Words]) -> list[int]:
    """The numbers of those labels that can be read: by rank, then in their order."""
    shown: list[int] = []
    for index in sorted(range(len(labels)), key=lambda i: labels[i].rank):
        if not any(labels[index].meets(labels[other]) for other in shown):
            shown.append(index)
    return sorted(shown)


def inside(words: Words, width: float, height: float) -> Words:
    """The same label, moved so that it lies in a region of this size where it fits at all."""
    left = max(PADDING, min(words.left, width - words.width - PADDING))
    bottom = max(PADDING, min(words.bottom, height - words.height - PADDING))
    return Words(left, bottom, words.width, words.height, words.rank)
