"""A grid on the ground, in whole metres where it can be. Without Blender."""

import math

import numpy as np

MOST_LINES = 25
"""Of one direction; wider spaces get wider meshes."""


def grid_lines(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The lines of a grid between two corners of the ground, without its border.

    Args:
        low: Smallest (x, y), metres.
        high: Largest (x, y), metres.

    Returns:
        (lines, 2, 3) ends at z = 0; none where the corners enclose nothing.
    """
    if not encloses(low, high):
        return np.zeros((0, 2, 3))
    mesh = mesh_of(low, high)
    lines = []
    for axis in (0, 1):
        across = 1 - axis
        for number in range(math.ceil(low[axis] / mesh), math.floor(high[axis] / mesh) + 1):
            ends = np.zeros((2, 3))
            ends[:, axis] = number * mesh
            ends[:, across] = low[across], high[across]
            lines.append(ends)
    return np.array(lines).reshape(-1, 2, 3)


def border_lines(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The four sides (4, 2, 3) of a rectangle on the ground; none where it encloses nothing."""
    if not encloses(low, high):
        return np.zeros((0, 2, 3))
    (left, near), (right, far) = low, high
    corners = np.array([(left, near, 0), (right, near, 0), (right, far, 0), (left, far, 0)], float)
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def mesh_of(low: np.ndarray, high: np.ndarray) -> float:
    """Metres between lines: the smallest of 1, 2, 5, 10, 20 ... that needs few enough of them.

    Spaces under two metres get tenths in the same manner.
    """
    widest = float(np.max(np.subtract(high, low)))
    smallest = widest / (MOST_LINES - 1)
    power = 10.0 ** math.floor(math.log10(smallest))
    mesh = next(power * step for step in (1, 2, 5, 10) if power * step >= smallest * (1 - 1e-9))
    return max(mesh, 1.0) if widest >= 2.0 else mesh


def encloses(low: np.ndarray, high: np.ndarray) -> bool:
    """Whether two corners are finite and have ground between them."""
    sides = np.subtract(high, low)
    return bool(np.isfinite([*low, *high]).all() and (sides > 1e-6).all() and (sides < 1e9).all())
