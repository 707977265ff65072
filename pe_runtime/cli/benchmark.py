"""`pe bench`: run time against error, and numerical stability."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from pe_runtime.cli.option_groups import grouped
from pe_runtime.cli.terminal import device, progress, show

Models = Annotated[
    list[str] | None,
    typer.Option(
        "--model",
        help="Name, file, or seeded-tennis; may be given again. Default: duel and seeded-tennis.",
    ),
]
Sections = Annotated[
    list[str] | None,
    typer.Option(
        "--only",
        help="points, pixels, objects, samples, frames or blender; may be given again.",
    ),
]


@dataclass(frozen=True)
class Thoroughness:
    """How long it takes, and how far the figures can be trusted."""

    frames: Annotated[int, typer.Option(min=2, help="Frames of each film.")] = 8
    repeats: Annotated[int, typer.Option(min=1, help="Runs of each point.")] = 3
    quick: Annotated[bool, typer.Option("--quick", help="Small and soon: does it work?")] = False


@grouped
def bench(
    model: Models = None,
    start: Annotated[Path | None, typer.Option(help="Clip or state file to start from.")] = None,
    thoroughness: Thoroughness = Thoroughness(),
    only: Sections = None,
    stress: Annotated[bool, typer.Option("--stress", help="Numerical stability instead.")] = False,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for JSON and plots.")] = Path(
        "benchmark"
    ),
) -> None:
    """Measure run time against error; writes OUT/benchmark.json, tables and two plots."""
    if stress:
        _stress(out)
        return
    from pe_runtime.benchmark import plan as plans
    from pe_runtime.benchmark.report import run_benchmark
    from pe_runtime.benchmark.results import write_results
    from pe_runtime.benchmark.tables import as_tables

    plan = plans.Plan(
        models=tuple(model or plans.DEFAULT_MODELS),
        start=None if start is None else str(start),
        device=device(),
        sections=tuple(only or plans.SECTIONS),
        frames=thoroughness.frames,
        repeats=thoroughness.repeats,
    )
    with progress("processes") as report_progress:
        report = run_benchmark(plans.quick(plan) if thoroughness.quick else plan, report_progress)
    write_results(report, out)
    show(report, as_tables(report))


def _stress(out: Path) -> None:
    from pe_runtime.benchmark.stress import run_stress, stress_table
    from pe_runtime.benchmark.tables import Sheet, as_table, sheet_as_markdown

    with progress("cases") as report_progress:
        report = run_stress(report_progress)
    found: dict[str, Any] = report.as_dict()
    out.mkdir(parents=True, exist_ok=True)
    (out / "stress.json").write_text(json.dumps(found, indent=1, allow_nan=False))
    headings, *rows = stress_table(report)
    title = "Numerical stability: worst errors against float64"
    sheet = Sheet(title, headings, tuple(rows))
    (out / "stress_table.md").write_text(sheet_as_markdown(sheet))
    show(found, as_table(sheet))
    if not report.passed:
        raise typer.Exit(1)
