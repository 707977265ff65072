"""People in a picture as the boxes of named players, from left to right."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from pe_runtime.evaluation.detection import Box
from pe_runtime.evaluation.detector_network import component_boxes


def find_players(
    logits: Float[np.ndarray, "height width"], names: Sequence[str]
) -> dict[str, tuple[Box, float]]:
    """Boxes of as many people as are named, the surest ones, and how sure each is.

    Nothing in a picture tells who is who: the first name gets the leftmost box, and so on. Where
    fewer people are found than names are given, the last names get none.

    Args:
        logits: How sure a detector is of a person at each pixel, see `PersonDetector.logits`.
        names: Players, from left to right.

    Returns:
        By name a box in pixels, and the mean probability of a person on its silhouette.
    """
    found = [(box, _surety(logits, box)) for box in component_boxes(logits > 0)]
    surest = sorted(found, key=lambda each: -each[1])[: len(names)]
    in_order = sorted(surest, key=lambda each: each[0][0] + each[0][2])
    return dict(zip(names, in_order, strict=False))


def _surety(logits: Float[np.ndarray, "height width"], box: Box) -> float:
    left, top, right, bottom = map(int, box)
    inside = logits[top:bottom, left:right]
    return float((1.0 / (1.0 + np.exp(-inside[inside > 0]))).mean())
