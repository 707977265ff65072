"""Places on the ground that a model knows by its static objects, and how well a camera meets them.

An artist who sees such a place in the picture need not measure where it is.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from pe_runtime.contract.camera import Camera, project
from pe_runtime.contract.model_facts import ModelFacts

FLAT = 0.05
"""Metres of height below which a volume is flat, and from the ground within which it touches it."""
FEWEST = 4
"""Points from which a camera can be matched."""
GOOD_RESIDUAL = 2.0
"""Pixels above which a matched camera should not be trusted."""
Place = tuple[float, float]


def landmarks(
    facts: ModelFacts | None, positions: Mapping[str, Sequence[float]] | None = None
) -> dict[str, Place]:
    """Named places (x, y) on the ground, metres: the corners of what stands or lies on it.

    Args:
        facts: The model's; None while no model is loaded.
        positions: Where a state has put static objects. Without one, only what is flat is named:
            that is the ground itself, which lies at the environment's origin.
    """
    found: dict[str, Place] = {}
    for name, volume in (facts.volumes if facts else {}).items():
        flat = volume.high[2] - volume.low[2] <= FLAT
        origin = (positions or {}).get(name, (0.0, 0.0, 0.0) if flat else None)
        if name in facts.playable_names or origin is None:
            continue
        if volume.low[2] + origin[2] - FLAT <= 0 <= volume.high[2] + origin[2] + FLAT:
            left, right = volume.low[0] + origin[0], volume.high[0] + origin[0]
            near, far = volume.low[1] + origin[1], volume.high[1] + origin[1]
            found |= {
                f"{name}: near left": (left, near),
                f"{name}: near right": (right, near),
                f"{name}: far right": (right, far),
                f"{name}: far left": (left, far),
            }
    return found


def misses(camera: Camera, points: Sequence[Sequence[float]]) -> np.ndarray:
    """How far from its pixel each point of the ground appears, (points,) pixels; NaN: nowhere.

    Args:
        camera: Environment space.
        points: [u, v, x, y]: a pixel, and metres on the ground.
    """
    listed = np.array(points, np.float64).reshape(-1, 4)
    places = np.column_stack([listed[:, 2:], np.zeros(len(listed))])
    pixels, _ = project(camera, places)
    return np.linalg.norm(pixels - listed[:, :2], axis=1)


def focal_of(field_of_view: float, width: int) -> float:
    """Focal length in pixels of a horizontal field of view in radians."""
    return float(width / 2 / np.tan(field_of_view / 2))
