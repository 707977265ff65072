"""Figures of a training run as curves."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

UNSHOWN = {"step", "minutes", "rate"}
RIGHT_OF_PLOT = (1.01, 1.0)


def write_curves(lines: Sequence[Mapping[str, float | int]], path: Path) -> None:
    """Draw the loss, the PSNRs, and all else that was logged, over the steps.

    Args:
        lines: Figures with the step that they belong to; not every line has every figure.
        path: PNG to write, atomically.
    """
    names = list(dict.fromkeys(name for line in lines for name in line))
    shown = [name for name in names if name not in UNSHOWN]
    decibels = [name for name in shown if name.startswith("psnr")]
    others = [name for name in shown if name != "loss" and name not in decibels]
    panels = [("loss", ["loss"] if "loss" in shown else []), ("dB", decibels), ("", others)]
    panels = [(unit, group) for unit, group in panels if group]
    figure = Figure(figsize=(9, 0.6 + 2.6 * max(1, len(panels))), layout="constrained")
    for number, (unit, group) in enumerate(panels, start=1):
        axes = figure.add_subplot(len(panels), 1, number)
        curves = {name: _curve(lines, name) for name in group}
        _draw(axes, {name: each for name, each in curves.items() if len(each)}, unit)
    figure.supxlabel("steps", fontsize=9)
    part = path.with_name(f".{path.name}.part")
    figure.savefig(part, dpi=110, format="png")
    part.replace(path)


def _draw(axes: Axes, curves: Mapping[str, Float[np.ndarray, "points 2"]], unit: str) -> None:
    for name, points in curves.items():
        mark = "." if len(points) < 40 else ""
        axes.plot(points[:, 0], points[:, 1], marker=mark, linewidth=1.2, label=name)
    if unit != "dB" and curves and all((points[:, 1] > 0).all() for points in curves.values()):
        axes.set_yscale("log")
    axes.set_ylabel(unit, fontsize=9)
    axes.grid(alpha=0.3)
    axes.tick_params(labelsize=8)
    axes.legend(fontsize=7, loc="upper left", bbox_to_anchor=RIGHT_OF_PLOT, frameon=False)


def _curve(lines: Sequence[Mapping[str, float | int]], name: str) -> Float[np.ndarray, "points 2"]:
    """Steps and values of one figure, without those that are not finite."""
    pairs = np.array([(line["step"], line[name]) for line in lines if name in line], dtype=float)
    return pairs[np.isfinite(pairs).all(axis=1)]
