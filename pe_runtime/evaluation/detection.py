"""Detections of recorded and drawn pictures held against each other: ADD and MDR (paper, Sec. 4).

Players of one class look alike to a detector of people, so detections are matched within each frame
and not by name.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import cv2
import numpy as np
from jaxtyping import Float
from scipy.optimize import linear_sum_assignment

from pe_runtime.evaluation.rules import RULES

Box = tuple[float, float, float, float]
FARTHEST_MATCH = RULES.farthest_match
"""Centres that lie farther apart than this share of the picture's width never match."""


@runtime_checkable
class Detector(Protocol):
    """Finds people in a picture; any callable with a name will do."""

    name: str

    def __call__(self, picture: Float[np.ndarray, "height width 3"]) -> list[Box]:
        """Boxes (left, top, right, bottom) in pixels of a float32 sRGB picture in [0, 1]."""


@dataclass(frozen=True)
class Pair:
    """A detection of the reference and the one that corresponds to it.

    Attributes:
        reference: Index among the reference's boxes.
        found: Index among the others.
        distance: Between the centres, pixels.
    """

    reference: int
    found: int
    distance: float


@dataclass(frozen=True)
class FrameDetections:
    """What a detector says about one drawn frame and its recorded one.

    Attributes:
        distances: Pixels between the centres of each matched pair.
        recorded: Detections in the recorded picture.
        width: Pixel columns.
    """

    distances: tuple[float, ...]
    recorded: int
    width: int


def compare(
    detector: Detector,
    drawn: Float[np.ndarray, "height width 3"],
    recorded: Float[np.ndarray, "height width 3"],
) -> FrameDetections:
    """Detect in both pictures and match."""
    return held_against(detector(recorded), detector(drawn), recorded.shape[1])


def held_against(recorded: Sequence[Box], drawn: Sequence[Box], width: int) -> FrameDetections:
    """Match the boxes of a drawn picture of so many columns with those of its recorded one."""
    pairs = match(recorded, drawn, width)
    return FrameDetections(tuple(pair.distance for pair in pairs), len(recorded), width)


def match(
    reference: Sequence[Box], found: Sequence[Box], width: int, farthest: float = FARTHEST_MATCH
) -> list[Pair]:
    """One-to-one correspondence of boxes with the least sum of centre distances.

    Pairs farther apart than allowed are given up; as many pairs as possible are kept.

    Args:
        reference: Boxes that should be found again.
        found: Boxes to choose from.
        width: Pixel columns of the picture.
        farthest: Greatest distance of matched centres as a share of the width.
    """
    if not reference or not found:
        return []
    distances = np.linalg.norm(_centres(reference)[:, None] - _centres(found)[None], axis=-1)
    limit = farthest * width
    # What is too far costs more than any set of allowed pairs, so it is chosen last.
    costs = np.where(distances <= limit, distances, 1e3 * limit * len(reference))
    rows, columns = linear_sum_assignment(costs)
    return [
        Pair(int(row), int(column), float(distances[row, column]))
        for row, column in zip(rows, columns, strict=True)
        if distances[row, column] <= limit
    ]


def average_detection_distance(frames: Sequence[FrameDetections]) -> float:
    """ADD in pixels: mean over all matched pairs; NaN without any."""
    distances = [distance for frame in frames for distance in frame.distances]
    return float(np.mean(distances)) if distances else math.nan


def relative_detection_distance(frames: Sequence[FrameDetections]) -> float:
    """ADD in percent of the picture's width; NaN without any pair."""
    shares = [distance / frame.width for frame in frames for distance in frame.distances]
    return 100.0 * float(np.mean(shares)) if shares else math.nan


def missing_detection_rate(frames: Sequence[FrameDetections]) -> float:
    """MDR in percent: recorded detections without a partner; NaN if nothing was detected."""
    recorded = sum(frame.recorded for frame in frames)
    matched = sum(len(frame.distances) for frame in frames)
    return 100.0 * (recorded - matched) / recorded if recorded else math.nan


class HistogramDetector:
    """OpenCV's pedestrian detector (histograms of gradients), for people about 96 pixels tall.

    Small pictures are enlarged fourfold. It needs no file, and misses many.
    """

    name = "hog"
    ENLARGED = 4

    def __init__(self) -> None:
        self.descriptor = cv2.HOGDescriptor()
        self.descriptor.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())

    def __call__(self, picture: Float[np.ndarray, "height width 3"]) -> list[Box]:
        """Boxes of people, best first."""
        image = np.clip(picture[..., ::-1] * 255 + 0.5, 0, 255).astype(np.uint8)
        factor = self.ENLARGED
        large = cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC)
        boxes, scores = self.descriptor.detectMultiScale(large, winStride=(8, 8), scale=1.05)
        order = np.argsort(-np.asarray(scores).reshape(-1), kind="stable")
        found = [tuple(int(v) for v in boxes[index]) for index in order]
        return [tuple(v / factor for v in (x, y, x + w, y + h)) for x, y, w, h in found]


def _centres(boxes: Sequence[Box]) -> np.ndarray:
    edges = np.asarray(boxes, dtype=np.float64)
    return (edges[:, :2] + edges[:, 2:]) / 2
