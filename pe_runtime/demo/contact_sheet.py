"""A contact sheet: the start picture and frames of the film, with what the players were told."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from pe_runtime.images import ImageError, read_image, to_uint8, write_png

COLUMNS = 3
MARGIN = 6
BAND = 34
"""Height in pixels of the strip under each picture that holds two lines of text."""
TEXT_SIZE = 0.36
INK, PAPER = 30, 245


@dataclass(frozen=True)
class Cell:
    """One picture of the sheet."""

    picture: Path
    title: str
    caption: str = ""


def write_contact_sheet(cells: Sequence[Cell], output: str | Path) -> None:
    """Lay pictures out in rows of three, each over its title and caption.

    Raises:
        ImageError: A picture cannot be read, or there is none.
    """
    if not cells:
        raise ImageError(f"{output}: there are no pictures to lay out")
    pictures = [to_uint8(read_image(cell.picture)) for cell in cells]
    height, width = pictures[0].shape[:2]
    rows = -(-len(cells) // COLUMNS)
    pitch = (height + BAND + MARGIN, width + MARGIN)
    shape = (rows * pitch[0] + MARGIN, min(COLUMNS, len(cells)) * pitch[1] + MARGIN, 3)
    sheet = np.full(shape, PAPER, np.uint8)
    for index, (cell, picture) in enumerate(zip(cells, pictures, strict=True)):
        top, left = (index // COLUMNS) * pitch[0] + MARGIN, (index % COLUMNS) * pitch[1] + MARGIN
        if picture.shape[:2] != (height, width):
            picture = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)
        sheet[top : top + height, left : left + width] = picture
        for line, text in enumerate((cell.title, cell.caption)):
            place = (left + 2, top + height + 13 + 14 * line)
            ink = (INK,) * 3
            cv2.putText(
                sheet, text, place, cv2.FONT_HERSHEY_SIMPLEX, TEXT_SIZE, ink, 1, cv2.LINE_AA
            )
    write_png(output, sheet)
