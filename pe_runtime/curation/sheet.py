"""A contact sheet of a data set: sequences below one another, moments side by side, with boxes."""

import math
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np

from pe_runtime.contract.episode import Episode, read_dataset, read_episode
from pe_runtime.contract.errors import EpisodeError
from pe_runtime.images import read_image, to_uint8, write_png

SEQUENCES, MOMENTS = 6, 6
MARGIN, BAND = 4, 15  # pixels; the band holds a line of text
PAPER, INK = 245, 30
TEXT_SIZE = 0.36
_SMALLEST_WIDTH = 256  # pixels of a picture on the sheet
_COLOURS = ((255, 210, 40), (60, 220, 255), (255, 110, 200), (140, 255, 110))


def write_dataset_sheet(
    roots: Mapping[str, Path],
    output: str | Path,
    sequences: int = SEQUENCES,
    moments: int = MOMENTS,
) -> None:
    """Draw a few sequences through their first camera, evenly chosen.

    Under each picture stand its split, sequence and frame, and the actions that the players take
    next.

    Args:
        roots: Data sets by the name of their split, each gets an equal share of the rows.
        output: The PNG file to write.
        sequences: Rows of the sheet.
        moments: Pictures in a row.

    Raises:
        EpisodeError: If a data set holds no complete sequence.
        ImageError: If a picture cannot be read, or the sheet not be written.
    """
    rows = []
    for split, root in roots.items():
        _, folders = read_dataset(root)
        if not folders:
            raise EpisodeError(f"{root} holds no complete sequence to show; record some first")
        for number in _evenly(len(folders), max(sequences // len(roots), 1)):
            episode = read_episode(folders[number])
            times = _evenly(episode.arrays.frames, moments)
            rows.append(np.concatenate([_cell(episode, t, split) for t in times], axis=1))
    width = max(row.shape[1] for row in rows)
    rows = [
        np.pad(row, ((0, 0), (0, width - row.shape[1]), (0, 0)), constant_values=PAPER)
        for row in rows
    ]
    write_png(output, np.concatenate(rows))


def _evenly(available: int, wanted: int) -> list[int]:
    """Up to `wanted` of the numbers 0 to `available` - 1, both ends among them."""
    count = min(available, wanted)
    return np.rint(np.linspace(0, available - 1, count)).astype(int).tolist()


def _cell(episode: Episode, frame: int, split: str) -> np.ndarray:
    """One picture with its boxes and a line of text below, (height, width, 3) uint8."""
    picture = to_uint8(read_image(episode.frame_path(0, frame)))
    enlarged = math.ceil(_SMALLEST_WIDTH / picture.shape[1])
    picture = np.ascontiguousarray(picture.repeat(enlarged, 0).repeat(enlarged, 1))
    for k, box in enumerate(episode.arrays.boxes[0, frame]):
        if np.isfinite(box).all():
            left, top, right, bottom = np.rint(box * enlarged).astype(int).tolist()
            # Edges of pixels lie between them: the last pixel inside is one less.
            corner, colour = (right - 1, bottom - 1), _COLOURS[k % len(_COLOURS)]
            cv2.rectangle(picture, (left, top), corner, colour, 1)
    height, width = picture.shape[:2]
    cell = np.full((height + BAND + MARGIN, width + MARGIN, 3), PAPER, np.uint8)
    cell[:height, :width] = picture
    text, place = _caption(episode, frame, split), (1, height + 11)
    cv2.putText(cell, text, place, cv2.FONT_HERSHEY_SIMPLEX, TEXT_SIZE, (INK,) * 3, 1, cv2.LINE_AA)
    return cell


def _caption(episode: Episode, frame: int, split: str) -> str:
    words = [f"{split} {episode.path.name} {frame:02d}".strip()]
    names = episode.info.actions
    if frame < len(episode.arrays.actions):
        taken = episode.arrays.actions[frame]
        words += [names[a] if 0 <= a < len(names) else "?" for a in taken.tolist()]
    return "  ".join(words)
