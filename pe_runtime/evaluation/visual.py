"""How close a picture is to the one recorded. Pictures are float in [0, 1], display-referred."""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import correlate1d

SMALLEST_ERROR = 1e-10
"""Mean squared error below which pictures count as equal: PSNR stays finite, at most 100 dB."""
WINDOW, SIGMA = 11, 1.5
K1, K2 = 0.01, 0.03


def psnr(
    picture: Float[np.ndarray, "height width 3"],
    reference: Float[np.ndarray, "height width 3"],
    mask: Bool[np.ndarray, "height width"] | None = None,
) -> float:
    """Peak signal-to-noise ratio in dB, peak 1, at most 100.

    Args:
        picture: What was drawn.
        reference: What was recorded.
        mask: Pixels that count; all without it.

    Returns:
        NaN if no pixel counts.
    """
    squares = (picture.astype(np.float64) - reference) ** 2
    counted = squares if mask is None else squares[mask]
    if counted.size == 0:
        return math.nan
    return -10.0 * math.log10(max(float(counted.mean()), SMALLEST_ERROR))


def ssim(
    picture: Float[np.ndarray, "height width 3"], reference: Float[np.ndarray, "height width 3"]
) -> float:
    """Structural similarity (Wang et al. 2004): Gaussian window 11 px, sigma 1.5, peak 1.

    The mean over colour channels and over the positions where the window fits into the picture.

    Returns:
        1 for equal pictures, NaN if a side is shorter than the window.
    """
    if min(picture.shape[:2]) < WINDOW:
        return math.nan
    x, y = picture.astype(np.float64), reference.astype(np.float64)
    mean_x, mean_y = _blur(x), _blur(y)
    variance_x = _blur(x * x) - mean_x**2
    variance_y = _blur(y * y) - mean_y**2
    covariance = _blur(x * y) - mean_x * mean_y
    alike = (2 * mean_x * mean_y + K1**2) * (2 * covariance + K2**2)
    scale = (mean_x**2 + mean_y**2 + K1**2) * (variance_x + variance_y + K2**2)
    return float((alike / scale).mean())


def box_mask(
    boxes: Sequence[Sequence[float]], height: int, width: int
) -> Bool[np.ndarray, "height width"]:
    """Pixels whose centre lies in any of the boxes.

    Args:
        boxes: (left, top, right, bottom) pixel edges; NaN boxes and empty ones cover nothing.
        height: Pixel rows.
        width: Pixel columns.
    """
    rows, columns = np.arange(height)[:, None] + 0.5, np.arange(width)[None, :] + 0.5
    mask = np.zeros((height, width), dtype=bool)
    for left, top, right, bottom in boxes:
        across = (columns >= left) & (columns < right)
        mask |= across & (rows >= top) & (rows < bottom)
    return mask


def _blur(values: Float[np.ndarray, "height width 3"]) -> Float[np.ndarray, "_ _ 3"]:
    """Gaussian means, only where the window lies inside the picture."""
    reach = np.arange(WINDOW) - WINDOW // 2
    weights = np.exp(-0.5 * (reach / SIGMA) ** 2)
    weights /= weights.sum()
    edge = WINDOW // 2
    blurred = correlate1d(correlate1d(values, weights, axis=0), weights, axis=1)
    return blurred[edge:-edge, edge:-edge]
