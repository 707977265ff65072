"""Pictures of the release as those of our episodes: flattened on white, resized, PNG."""

import shutil
from pathlib import Path

import numpy as np

from pe_runtime.contract.errors import EpisodeError
from pe_runtime.images import ImageError, is_rgb_png, read_image, write_png

WHITE = 1.0


def import_picture(source: Path, target: Path, size: tuple[int, int]) -> None:
    """Write a picture as an 8-bit RGB PNG of a size; one that is that already keeps its bytes.

    Args:
        source: Any picture; where it is transparent, white shows.
        target: The PNG.
        size: Pixel columns and rows.

    Raises:
        EpisodeError: The picture is damaged.
        ImageError, OSError: The PNG cannot be written.
    """
    try:
        pixels = read_image(source, background=WHITE)
    except ImageError as error:
        raise EpisodeError(str(error)) from error
    if is_rgb_png(source, size):
        shutil.copyfile(source, target)
    else:
        write_png(target, resized(pixels, size))


def resized(pixels: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """A picture (height, width, channels) on another grid, by the release's own filter.

    That is a triangle of two pixels' width, of the coarser grid: linear between pixels where the
    picture grows, an average without gaps where it shrinks. It mixes sRGB values, as the release.

    Args:
        pixels: float32.
        size: Pixel columns and rows.
    """
    width, height = size
    if pixels.shape[:2] == (height, width):
        return pixels
    rows, columns = _weights(pixels.shape[0], height), _weights(pixels.shape[1], width)
    narrow = np.einsum("ij,rjc->ric", columns, pixels, optimize=True)
    return np.einsum("ij,jkc->ikc", rows, narrow, optimize=True)


def _weights(old: int, new: int) -> np.ndarray:
    """(new, old) float32 share of each old pixel in each new one."""
    step = old / new
    centres = (np.arange(new) + 0.5) * step
    distances = np.abs(np.arange(old) + 0.5 - centres[:, None])
    weights = np.maximum(0.0, 1.0 - distances / max(step, 1.0))
    return (weights / weights.sum(1, keepdims=True)).astype(np.float32)
