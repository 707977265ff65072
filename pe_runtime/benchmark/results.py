"""A benchmark's files: JSON for programs, Markdown and plots for people."""

import json
from pathlib import Path
from typing import Any

from pe_runtime.benchmark.plots import write_cost_plot, write_error_plot
from pe_runtime.benchmark.tables import as_markdown

COSTS = ("pixels", "objects", "samples", "frames")


def write_results(report: dict[str, Any], folder: Path) -> list[Path]:
    """Write benchmark.json, benchmark_tables.md, and the plots that have something to show."""
    folder.mkdir(parents=True, exist_ok=True)
    written = [folder / "benchmark.json", folder / "benchmark_tables.md"]
    for path, text in zip(written, (_json(report), as_markdown(report)), strict=True):
        unfinished = path.with_name(f".{path.name}")
        unfinished.write_text(text)
        unfinished.replace(path)
    if any(model.get("points") for model in report["models"]):
        written.append(folder / "benchmark_error.png")
        write_error_plot(report, written[-1])
    if any(model.get(name) for model in report["models"] for name in COSTS):
        written.append(folder / "benchmark_cost.png")
        write_cost_plot(report, written[-1])
    return written


def _json(report: dict[str, Any]) -> str:
    return json.dumps(report, indent=1, allow_nan=False) + "\n"
