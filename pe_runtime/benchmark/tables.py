"""A report for people: the same tables for the terminal (rich) and for documents (Markdown)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Group
from rich.table import Table

Record = Mapping[str, Any]


@dataclass(frozen=True)
class Sheet:
    """One table as text: the first column is text, the others are numbers."""

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""


def sheets(report: Record) -> list[Sheet]:
    """All tables of a report, model by model."""
    makers = (
        ("points", _points),
        ("points", _errors),
        ("pixels", _pixels),
        ("objects", _objects),
        ("samples", _samples),
        ("frames", _frames),
    )
    found = []
    for model in report["models"]:
        for name, make in makers:
            if model.get(name):
                found.append(make(model, machine_line(report["machine"])))
    if report.get("blender"):
        found.append(_blender(report["blender"]))
    return found


def as_tables(report: Record) -> Group:
    """For the terminal."""
    return Group(*map(as_table, sheets(report)))


def as_table(sheet: Sheet) -> Table:
    """One table for the terminal, as wide as its numbers need."""
    looks = {"box": SIMPLE_HEAD, "title_justify": "left", "caption_justify": "left"}
    table = Table(title=sheet.title, caption=sheet.caption or None, **looks)
    for number, heading in enumerate(sheet.headings):
        # A cut or folded number is no number; better a wide line.
        width = max(len(heading), *(len(row[number]) for row in sheet.rows))
        justify = "right" if number else "left"
        table.add_column(heading, justify=justify, min_width=width, no_wrap=True)
    for row in sheet.rows:
        table.add_row(*row)
    return table


def as_markdown(report: Record) -> str:
    """For documents."""
    return "\n".join(map(sheet_as_markdown, sheets(report)))


def sheet_as_markdown(sheet: Sheet) -> str:
    """One table for documents."""
    rule = "| --- |" + " ---: |" * (len(sheet.headings) - 1)
    lines = [_line(sheet.headings), rule, *map(_line, sheet.rows)]
    return "\n".join([f"**{sheet.title}**", "", *lines, "", sheet.caption]).strip() + "\n"


def machine_line(machine: Record) -> str:
    """What was measured on, in one line."""
    return (
        f"{machine['processor']}, {machine['cores']} cores, {machine['threads']} torch threads, "
        f"bfloat16: {machine['bfloat16']}, torch {machine['torch']}, "
        f"200000x256x256 product {machine['gflops_float32']:.0f} GFLOP/s in float32 and "
        f"{machine['gflops_bfloat16']:.0f} in bfloat16"
    )


def title_of(model: Record) -> str:
    """Model and picture size."""
    return f"{model['model']}, {model['width']}x{model['height']}"


def milliseconds(seconds: Record) -> str:
    """Median and half the distance of the quartiles, such as `71.2 ±0.9`."""
    median, half = 1000 * seconds["median"], 500 * (seconds["high"] - seconds["low"])
    return f"{figures(median)} ±{half:.{0 if median >= 99.5 else 1}f}"


def _points(model: Record, machine: str) -> Sheet:
    usual = model["points"][0]["seconds"]["moving"]["median"]
    rows = []
    for each in model["points"]:
        seconds, own = each["seconds"], each["errors"]["float64"]
        rows.append(
            (
                each["name"],
                *(milliseconds(seconds[key]) for key in ("first", "moving", "standing")),
                f"{usual / seconds['moving']['median']:.2f}",
                f"{own['max_abs']:.1e}",
                _decibels(own["psnr"]),
                _mebibytes(each["memory"]["peak"]),
            )
        )
    headings = ("quality", "first", "moving", "standing", "times", "max error", "PSNR", "MiB")
    caption = (
        "Milliseconds of a first frame and of following ones with a moving and a standing camera, "
        "median and half the distance of the quartiles; times as fast as plain modules (moving); "
        f"error and PSNR (dB) against float64; peak memory of the process. {machine}."
    )
    return Sheet(f"{title_of(model)}: run time and error", headings, tuple(rows), caption)


def _errors(model: Record, machine: str) -> Sheet:
    rows = []
    for each in model["points"]:
        own, true = each["errors"]["float64"], each["errors"]["converged"]
        rows.append(
            (
                each["name"],
                f"{own['rmse']:.1e}",
                f"{own['perceptual']:.1e}",
                f"{true['max_abs']:.1e}",
                _decibels(true["psnr"]),
                f"{true['perceptual']:.1e}",
                milliseconds(each["seconds"]["still"]),
                milliseconds(each["seconds"]["cold"]),
            )
        )
    headings = (
        *("quality", "RMSE", "perceptual", "c. max", "c. PSNR", "c. perceptual"),
        *("unchanged", "cold"),
    )
    caption = (
        "Errors against float64 and (c.) against the converged integral; milliseconds of a frame "
        "in which nothing changed, and of the first one in a process."
    )
    return Sheet(f"{title_of(model)}: further figures", headings, tuple(rows), caption)


def _pixels(model: Record, machine: str) -> Sheet:
    rows, slopes = [], []
    for quality, found in model["pixels"].items():
        slopes.append(f"{quality} {found['slope']:.2f}")
        for size in found["sizes"]:
            per = 1e9 * size["seconds"]["median"] / size["pixels"]
            label = f"{quality}, {size['width']}x{size['height']}"
            rows.append((label, milliseconds(size["seconds"]), f"{per:.0f}"))
    headings = ("quality, size", "moving camera, ms", "ns a pixel")
    caption = f"Exponent of pixels (1: in proportion): {', '.join(slopes)}."
    return Sheet(f"{title_of(model)}: cost of pixels", headings, tuple(rows), caption)


def _objects(model: Record, machine: str) -> Sheet:
    rows = [
        (_cast(each), milliseconds(each["seconds"]), f"{each['relative']:.3f}")
        for each in model["objects"]
    ]
    headings = ("players", "moving camera, ms", "relative")
    return Sheet(f"{title_of(model)}: cost of objects, exact", headings, tuple(rows))


def _samples(model: Record, machine: str) -> Sheet:
    rows = [
        (
            f"x {each['factor']:g}",
            milliseconds(each["seconds"]),
            f"{each['converged']['rmse']:.1e}",
            _decibels(each["converged"]["psnr"]),
        )
        for each in model["samples"]
    ]
    headings = ("samples", "moving camera, ms", "RMSE to converged", "PSNR, dB")
    return Sheet(f"{title_of(model)}: cost of samples, exact", headings, tuple(rows))


def _frames(model: Record, machine: str) -> Sheet:
    rows = []
    for each in model["frames"]:
        growth = "-" if each["growth"] is None else f"{100 * each['growth']:+.1f} %"
        last = each["memory"].get(str(each["frames"]))
        first = each["memory"].get("1")
        rows.append(
            (each["film"], str(each["frames"]), _mebibytes(first), _mebibytes(last), growth)
        )
    headings = ("film", "frames", "peak MiB after one", "after all", "growth")
    return Sheet(f"{title_of(model)}: memory over frames, balanced", headings, tuple(rows))


def _blender(found: Record) -> Sheet:
    title = f"path through Blender, {found['width']}x{found['height']}: ms a frame"
    if "skipped" in found:
        return Sheet(title, ("not measured",), ((found["skipped"],),))
    parts = tuple(found["costs"][0]["parts"])
    rows = tuple(
        (
            f"{each['way']}, {len(each['passes'])} more passes",
            f"{each['overhead']:.1f}",
            f"{each['drawing']:.1f}",
            *(f"{each['parts'][name]:.1f}" for name in parts),
        )
        for each in found["costs"]
    )
    caption = f"Overhead over the worker's own drawing, medians; Blender {found['blender']}."
    return Sheet(title, ("way", "overhead", "drawing", *parts), rows, caption)


def _cast(each: Record) -> str:
    count = f"{each['count']} " if each["count"] else ""
    known = {
        "as found": "as found",
        "absent": "absent: the static scene alone",
        "hidden": "all hidden",
        "more hidden": f"and {count}more, hidden",
        "out of view": f"and {count}more, out of view",
        "in view": f"and {count}more, in view",
    }
    return known[each["cast"]]


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def figures(value: float) -> str:
    """Three digits, or all before the point."""
    return f"{value:.0f}" if value >= 99.5 else f"{value:#.3g}"


def _decibels(value: float | None) -> str:
    return "equal" if value is None else f"{value:.1f}"


def _mebibytes(value: float | None) -> str:
    return "-" if value is None else f"{value:.0f}"
