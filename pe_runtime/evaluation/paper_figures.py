"""The figures of the paper's tables, each with its interval over sequences."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pe_runtime.evaluation.confidence import Figure, bootstrap, bootstrap_mean
from pe_runtime.evaluation.detection import (
    FrameDetections,
    average_detection_distance,
    missing_detection_rate,
    relative_detection_distance,
)
from pe_runtime.evaluation.frechet import frechet_distance
from pe_runtime.evaluation.playback import Shown

LARGEST_RESAMPLED = 256
"""Features beyond which a Frechet distance is measured once: its interval would take hours."""


@dataclass(frozen=True)
class Column:
    """A column of the paper's tables.

    Attributes:
        heading: With the arrow that says which way is better.
        unit: Of its numbers.
    """

    heading: str
    unit: str = ""


COLUMNS = {
    "psnr": Column("PSNR↑", "dB"),
    "ssim": Column("SSIM↑"),
    "lpips": Column("LPIPS↓"),
    "lpips_r": Column("LPIPS-R↓"),
    "fid": Column("FID↓"),
    "fd_r": Column("FD-R↓"),
    "fvd_r": Column("FVD-R↓"),
    "delta_mse": Column("Δ-MSE↓", "%"),
    "delta_accuracy": Column("Δ-Acc↑", "%"),
    "add": Column("ADD↓", "px"),
    "mdr": Column("MDR↓", "%"),
    "add_of_width_last": Column("ADD last↓", "% width"),
}
"""In the order of the paper; those of stand-ins end in -R."""

STAND_INS = {
    "lpips_r": "LPIPS-R: like LPIPS, on fixed random filters instead of a trained network",
    "fd_r": "FD-R: Frechet distance of pooled features of frames from fixed random filters",
    "fvd_r": "FVD-R: the same of clips and of the differences between their frames",
}
"""What the names mean; their numbers are not comparable with published LPIPS, FID and FVD."""


def picture_figures(shown: Sequence[Shown]) -> dict[str, Figure]:
    """Figures of one model's drawn sequences: pictures, sets of pictures, detections."""
    figures = {
        name: bootstrap_mean([each.pairs[name] for each in shown]) for name in shown[0].pairs
    }
    for kind in ("frames", "clips"):
        for name in getattr(shown[0], kind):
            figures[name] = _frechet_figure(shown, kind, name)
    if shown[0].detections:
        figures["add"] = _of_detections(shown, average_detection_distance)
        figures["mdr"] = _of_detections(shown, missing_detection_rate)
        figures["add_of_width_last"] = bootstrap(
            shown, lambda drawn: relative_detection_distance([e.detections[-1] for e in drawn])
        )
    return figures


def distance_by_step(shown: Sequence[Shown]) -> list[float]:
    """ADD of each frame of the sequences, in percent of the width; as far as the shortest goes."""
    shortest = min((len(each.detections) for each in shown), default=0)
    return [
        relative_detection_distance([each.detections[step] for each in shown])
        for step in range(shortest)
    ]


def _frechet_figure(shown: Sequence[Shown], kind: str, name: str) -> Figure:
    def distance(drawn: Sequence[Shown]) -> float:
        pairs = [getattr(each, kind)[name] for each in drawn]
        return frechet_distance(*(np.concatenate(side) for side in zip(*pairs, strict=True)))

    if getattr(shown[0], kind)[name][0].shape[1] > LARGEST_RESAMPLED:
        return Figure(distance(shown), math.nan, math.nan, len(shown))
    return bootstrap(shown, distance)


def _of_detections(
    shown: Sequence[Shown], measure: Callable[[Sequence[FrameDetections]], float]
) -> Figure:
    return bootstrap(shown, lambda drawn: measure([f for each in drawn for f in each.detections]))
