"""A picture in the terminal: two pixels per character, one above the other."""

from collections.abc import Iterator

import cv2
import numpy as np
from rich.color import Color
from rich.console import Console, ConsoleOptions
from rich.measure import Measurement
from rich.segment import Segment
from rich.style import Style

from pe_runtime.images import to_uint8

UPPER_HALF = "▀"
COLOURFUL = ("truecolor", "256")


class Preview:
    """A picture for rich, as large as fits.

    Args:
        picture: (height, width, 3) in [0, 1].
        columns: Characters that fit beside each other.
        rows: Lines that fit below each other.
    """

    def __init__(self, picture: np.ndarray, columns: int, rows: int) -> None:
        height, width = picture.shape[:2]
        # A character is about twice as high as wide: its two pixels are square.
        scale = min(columns / width, 2 * rows / height)
        size = max(1, int(width * scale)), 2 * max(1, int(height * scale / 2))
        self.pixels = to_uint8(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Segment]:
        """Lines of coloured half blocks."""
        for upper, lower in zip(self.pixels[::2], self.pixels[1::2], strict=True):
            for top, bottom in zip(upper.tolist(), lower.tolist(), strict=True):
                style = Style(color=Color.from_rgb(*top), bgcolor=Color.from_rgb(*bottom))
                yield Segment(UPPER_HALF, style)
            yield Segment.line()

    def __rich_measure__(self, console: Console, options: ConsoleOptions) -> Measurement:
        """As many characters as pixels."""
        return Measurement(self.pixels.shape[1], self.pixels.shape[1])


def can_preview(console: Console) -> bool:
    """Whether a terminal has colours enough for a picture."""
    return console.is_terminal and console.color_system in COLOURFUL
