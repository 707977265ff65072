"""A report as two pictures: run time against error, and what pixels, objects and frames cost."""

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from pe_runtime.benchmark.tables import figures, machine_line, title_of

Record = Mapping[str, Any]
FILMS = (
    ("first", "o", "first frame"),
    ("moving", "s", "following frames, moving camera"),
    ("standing", "^", "following frames, standing camera"),
)
PRESET_COLOURS = ("#1b6ca8", "#d1495b", "#3c8d40", "#8a4fbf")
BASELINE_COLOUR = "#222222"
SWITCH_COLOURS = ("#e08e0b", "#6b8fb3", "#b07aa1", "#9c755f", "#59a89c", "#7f7f7f", "#a3a847")
EQUAL = 1e-9
"""Where pictures are drawn that equal the true one to the last bit."""
LABEL_GAP = 0.045
"""Least distance of two labels, share of the panel's height."""


def write_error_plot(report: Record, path: Path) -> None:
    """One panel per model: each quality is a row of marks at its error, one mark per film."""
    models = [each for each in report["models"] if each.get("points")]
    figure = Figure(figsize=(10.5, 0.9 + 5.4 * len(models)), layout="constrained")
    for number, model in enumerate(models, start=1):
        axes = figure.add_subplot(len(models), 1, number)
        _error_panel(axes, model, report["plan"]["finer"])
    figure.supxlabel(machine_line(report["machine"]), fontsize=7, color="#555555")
    _save(figure, path)


def write_cost_plot(report: Record, path: Path) -> None:
    """One row of panels per model: pixels, objects, samples, frames."""
    panels = {
        "pixels": _pixels_panel,
        "objects": _objects_panel,
        "samples": _samples_panel,
        "frames": _frames_panel,
    }
    names = [n for n in panels if any(model.get(n) for model in report["models"])]
    models = [each for each in report["models"] if any(each.get(n) for n in names)]
    size = (4.2 * max(1, len(names)), 0.8 + 3.6 * len(models))
    figure = Figure(figsize=size, layout="constrained")
    for row, model in enumerate(models):
        for column, name in enumerate(names):
            if model.get(name):
                place = row * len(names) + column + 1
                axes = figure.add_subplot(len(models), len(names), place)
                panels[name](axes, model)
                axes.set_title(f"{title_of(model)}: {name}", fontsize=9)
    figure.supxlabel(machine_line(report["machine"]), fontsize=7, color="#555555")
    _save(figure, path)


def _save(figure: Figure, path: Path) -> None:
    unfinished = path.with_name(f".{path.name}")
    figure.savefig(unfinished, dpi=110, format=path.suffix[1:])
    unfinished.replace(path)


def _error_panel(axes: Axes, model: Record, finer: int) -> None:
    points = model["points"]
    errors = [max(each["errors"]["float64"]["rmse"], EQUAL) for each in points]
    left = {
        "baseline": itertools.cycle((BASELINE_COLOUR,)),
        "preset": itertools.cycle(PRESET_COLOURS),
        "switch": itertools.cycle(SWITCH_COLOURS),
    }
    colours = [next(left[point["kind"]]) for point in points]
    for point, error, colour in zip(points, errors, colours, strict=True):
        times = [1000 * point["seconds"][key]["median"] for key, _, _ in FILMS]
        axes.plot(times, [error] * len(times), color=colour, linewidth=0.8, alpha=0.6)
        for (key, mark, _), time in zip(FILMS, times, strict=True):
            spread = point["seconds"][key]
            ends = [[time - 1000 * spread["low"]], [1000 * spread["high"] - time]]
            axes.errorbar(time, error, xerr=ends, color=colour, linewidth=0.8, capsize=2)
            face = colour if point["kind"] != "switch" else "white"
            axes.plot(time, error, mark, color=colour, markerfacecolor=face, markersize=7)
    axes.set(xscale="log", yscale="log", xlabel="milliseconds a frame", ylabel="RMSE to float64")
    limit = points[0]["errors"]["converged"]["rmse"]
    axes.axhline(limit, color="#555555", linestyle=":", linewidth=1)
    label = f"error of the quadrature itself (exact against {finer} times the samples)"
    axes.annotate(label, (0.01, limit), xycoords=("axes fraction", "data"), fontsize=7, va="bottom")
    axes.set_ylim(min(errors) / 4, max([*errors, limit]) * 4)
    _plain_numbers(axes.xaxis)
    axes.grid(which="major", alpha=0.25)
    axes.set_title(f"{title_of(model)}: run time against error", fontsize=10)
    times = [1000 * point["seconds"]["moving"]["median"] for point in points]
    names = [f"{p['name']}, {figures(time)} ms" for p, time in zip(points, times, strict=True)]
    _label_rows(axes, names, errors, colours)
    for _, mark, text in FILMS:
        axes.plot([], [], mark, color="#333333", label=text)
    below = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.1), "frameon": False}
    axes.legend(fontsize=8, ncols=len(FILMS), **below)


def _label_rows(
    axes: Axes, names: Sequence[str], errors: Sequence[float], colours: Sequence[str]
) -> None:
    """Names right of the panel at the height of their errors, pushed apart where they are close."""
    low, high = np.log(axes.get_ylim())
    heights = (np.log(errors) - low) / (high - low)
    placed = spaced(heights.tolist(), LABEL_GAP)
    for name, height, label, colour in zip(names, heights, placed, colours, strict=True):
        axes.annotate(
            name,
            (1.0, height),
            (1.03, label),
            xycoords="axes fraction",
            textcoords="axes fraction",
            fontsize=8,
            va="center",
            color=colour,
            arrowprops={
                "arrowstyle": "-",
                "color": colour,
                "linewidth": 0.6,
                "relpos": (0.0, 0.5),
                "shrinkA": 1,
            },
            annotation_clip=False,
        )


def spaced(heights: Sequence[float], gap: float) -> list[float]:
    """Heights moved apart as little as a sweep can, in their order, none closer than the gap.

    E.g. (0.50, 0.51) with a gap of 0.05 gives (0.48, 0.53): groups stay about where they were.
    """
    order = sorted(range(len(heights)), key=lambda index: heights[index])
    groups: list[list[int]] = []
    for index in order:
        groups.append([index])
        while len(groups) > 1 and _bottom(groups[-1], heights, gap) < (
            _bottom(groups[-2], heights, gap) + gap * len(groups[-2])
        ):
            groups[-2:] = [groups[-2] + groups[-1]]
    placed = list(heights)
    for group in groups:
        for place, index in enumerate(group):
            placed[index] = _bottom(group, heights, gap) + gap * place
    return placed


def _bottom(group: Sequence[int], heights: Sequence[float], gap: float) -> float:
    middle = sum(heights[index] for index in group) / len(group)
    return middle - gap * (len(group) - 1) / 2


def _plain_numbers(*axes: Axis) -> None:
    """1, 2, 5, 10 along logarithmic axes instead of powers."""
    for axis in axes:
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter(FuncFormatter(lambda value, place: f"{value:,.10g}"))
        axis.set_minor_formatter(NullFormatter())


def _pixels_panel(axes: Axes, model: Record) -> None:
    for (quality, found), colour in zip(model["pixels"].items(), PRESET_COLOURS, strict=False):
        pixels = [size["pixels"] for size in found["sizes"]]
        times = [1000 * size["seconds"]["median"] for size in found["sizes"]]
        label = f"{quality}: exponent {found['slope']:.2f}"
        axes.plot(pixels, times, "o-", color=colour, label=label)
    axes.set(xscale="log", yscale="log", xlabel="pixels", ylabel="milliseconds a frame")
    axes.grid(which="both", alpha=0.2)
    _plain_numbers(axes.xaxis, axes.yaxis)
    axes.tick_params(axis="x", rotation=30)
    axes.legend(fontsize=8)


def _objects_panel(axes: Axes, model: Record) -> None:
    rows = model["objects"][::-1]
    names = [f"{r['cast']} +{r['count']}" if r["count"] else r["cast"] for r in rows]
    axes.barh(names, [1000 * r["seconds"]["median"] for r in rows], color=PRESET_COLOURS[0])
    for place, row in enumerate(rows):
        time = 1000 * row["seconds"]["median"]
        axes.annotate(f" {row['relative']:.2f}", (time, place), va="center", fontsize=7)
    axes.margins(x=0.12)
    axes.set(xlabel="milliseconds a frame (and relative to as found)")
    axes.tick_params(axis="y", labelsize=8)


def _samples_panel(axes: Axes, model: Record) -> None:
    rows = model["samples"]
    factors = [row["factor"] for row in rows]
    axes.plot(factors, [1000 * r["seconds"]["median"] for r in rows], "o-", color=PRESET_COLOURS[0])
    axes.set(xscale="log", yscale="log", xlabel="times the samples", ylabel="milliseconds a frame")
    _plain_numbers(axes.xaxis, axes.yaxis)
    axes.grid(alpha=0.2)
    other = axes.twinx()
    errors = [max(row["converged"]["rmse"], EQUAL) for row in rows]
    other.plot(factors, errors, "^--", color=PRESET_COLOURS[1])
    other.set_yscale("log")
    other.set_ylabel("RMSE to converged (triangles)", color=PRESET_COLOURS[1])


def _frames_panel(axes: Axes, model: Record) -> None:
    for row, colour in zip(model["frames"], PRESET_COLOURS, strict=False):
        if row["memory"]:
            frames = [int(n) for n in row["memory"]]
            label = f"{row['film']}: {100 * row['growth']:+.1f} %"
            axes.plot(frames, list(row["memory"].values()), "o-", color=colour, label=label)
            axes.set_xscale("log")
            axes.set_xticks(frames, [str(n) for n in frames])
    axes.minorticks_off()
    axes.set(xlabel="frames drawn", ylabel="peak MiB of the process")
    axes.set_ylim(0, 1.15 * axes.get_ylim()[1])
    axes.grid(alpha=0.2)
    axes.legend(fontsize=8, loc="lower right")
