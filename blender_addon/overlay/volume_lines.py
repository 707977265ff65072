"""The edges of a volume that stands somewhere, turned. Without Blender."""

import numpy as np

from pe_runtime.contract.model_facts import Volume

_CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
_EDGES = [
    (a, b)
    for a in range(8)
    for b in range(a + 1, 8)
    if np.abs(_CORNERS[a] - _CORNERS[b]).sum() == 1
]


def volume_edges(volume: Volume, position: np.ndarray, heading: float = 0.0) -> np.ndarray:
    """The twelve edges of a volume as lines.

    Args:
        volume: Metres along the object's axes.
        position: (3,) where the object stands.
        heading: Turn about z, radians.

    Returns:
        (12, 2, 3) ends.
    """
    low, high = np.array(volume.low), np.array(volume.high)
    corners = turned(low + _CORNERS * (high - low), heading) + np.asarray(position, np.float64)
    return corners[np.array(_EDGES)]


def head_of(volume: Volume | None, position: np.ndarray) -> np.ndarray:
    """The point (3,) over the middle of a volume's top, where a name can stand."""
    above = 0.0 if volume is None else volume.high[2]
    return np.asarray(position, np.float64) + (0.0, 0.0, above)


def heading_arrow(position: np.ndarray, heading: float, length: float) -> np.ndarray:
    """An arrow on the ground towards where an object looks: (3, 2, 3) ends.

    An object of heading 0 looks along y.
    """
    tip, barb = np.array([0.0, length, 0.0]), length / 4
    sides = [(-barb, length - barb, 0.0), (barb, length - barb, 0.0)]
    ends = np.array([[np.zeros(3), tip], [tip, sides[0]], [tip, sides[1]]])
    return turned(ends, heading) + np.asarray(position, np.float64)


def turned(points: np.ndarray, heading: float) -> np.ndarray:
    """Points (..., 3) turned about z."""
    sine, cosine = np.sin(heading), np.cos(heading)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(points, np.float64) @ turn.T
