"""`pe evaluate` and `pe train detector`."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from pe_runtime.cli.option_groups import grouped
from pe_runtime.cli.pictures import DEFAULT_MODEL, Model
from pe_runtime.cli.terminal import device, note, progress, show

ALL = "all"


@dataclass(frozen=True)
class Tabled:
    """Options of the paper's tables."""

    table: Annotated[
        str | None,
        typer.Option(
            help="A table of the paper: reconstruction, playability, camera, ablation-synthesis, "
            "ablation-actions, long-play, or all that the models allow."
        ),
    ] = None
    runs: Annotated[
        Path | None, typer.Option(help="Folder with one run per row, instead of --model.")
    ] = None
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder for report.json, table.md and sample sheets."),
    ] = None


@dataclass(frozen=True)
class Measuring:
    """Options of what is measured with."""

    detector: Annotated[
        str, typer.Option(help="Who finds people for ADD and MDR: own, hog, masks or none.")
    ] = "own"
    detector_file: Annotated[
        Path | None, typer.Option(help="A detector by `pe train detector`, as `own`.")
    ] = None
    vgg: Annotated[Path | None, typer.Option(help="VGG16 weights, for LPIPS proper.")] = None
    lpips_heads: Annotated[
        Path | None, typer.Option(help="Heads of LPIPS 0.1 (vgg.pth), for LPIPS proper.")
    ] = None
    inception: Annotated[
        Path | None, typer.Option(help="Inception weights of torch-fidelity, for FID proper.")
    ] = None


@grouped
def evaluate(
    data: Annotated[Path, typer.Option(help="Recorded data set the model has not seen.")],
    tabled: Tabled,
    measuring: Measuring,
    model: Model = DEFAULT_MODEL,
    limit: Annotated[int | None, typer.Option(min=1, help="Only so many sequences.")] = None,
    every: Annotated[
        int, typer.Option(min=1, help="Without --table: draw each n-th frame of a sequence.")
    ] = 3,
) -> None:
    """Measure models on held-out sequences: pictures, actions, positions, detections.

    Without --table: all figures of one model. With it: the paper's tables, a row a model.
    """
    if tabled.table is None and tabled.runs is None:
        _all_figures(data, model, (limit, every), tabled.out, measuring)
        return
    from pe_runtime.evaluation.instruments import set_up
    from pe_runtime.evaluation.learnt_features import WeightFiles

    files = WeightFiles(measuring.vgg, measuring.lpips_heads, measuring.inception)
    instruments = set_up(measuring.detector, measuring.detector_file, files)
    _paper_tables(data, model, limit, tabled, instruments)


def train_detector(
    data: Annotated[Path, typer.Option(help="Data set with masks, recorded by Blender.")],
    output: Annotated[Path, typer.Option("--out", "-o", help="File to write.")],
    test: Annotated[
        Path | None, typer.Option(help="Held-out data set on which its mistakes are counted.")
    ] = None,
    steps: Annotated[int, typer.Option(min=1, help="Optimisation steps.")] = 700,
) -> None:
    """Train the person detector behind ADD and MDR on the recorder's masks."""
    from pe_runtime.evaluation.detector_network import load_detector
    from pe_runtime.evaluation.detector_training import (
        DetectorTraining,
        detector_figures,
    )
    from pe_runtime.evaluation.detector_training import train_detector as train

    with progress("steps") as report:
        file = train(data, output, DetectorTraining(steps=steps), report)
    figures = {} if test is None else detector_figures(load_detector(file), test)
    show({"detector": str(file), "bytes": file.stat().st_size} | figures)


def _all_figures(
    data: Path, model: str, sizes: tuple[int | None, int], out: Path | None, measuring: Measuring
) -> None:
    from pe_runtime.environment import PlayableEnvironment
    from pe_runtime.evaluation.detector_network import PersonDetector
    from pe_runtime.evaluation.instruments import set_up
    from pe_runtime.evaluation.paper_tables import write_texts
    from pe_runtime.evaluation.protocol import evaluate as measure
    from pe_runtime.evaluation.tables import as_json, as_lines, as_table

    environment = PlayableEnvironment.load(model, device())
    found = set_up(measuring.detector, measuring.detector_file).detector
    silhouette = found.silhouette if isinstance(found, PersonDetector) else None
    with progress("sequences") as report:
        figures = measure(environment, data, *sizes, report, silhouette)
    text = as_json(figures)
    if out is not None:
        write_texts(out, {"report.json": text, "table.md": as_lines(figures)})
        _write_sheets(environment, data, out)
    show(json.loads(text), as_table(figures))


def _paper_tables(
    data: Path,
    model: str,
    limit: int | None,
    tabled: Tabled,
    instruments: Any,  # noqa: ANN401
) -> None:
    from rich.console import Group

    from pe_runtime.contract.episode import read_dataset
    from pe_runtime.evaluation.comparison import measure_rows
    from pe_runtime.evaluation.contenders import contenders_of, fitting_tables
    from pe_runtime.evaluation.paper_tables import as_rich, notes, write_report
    from pe_runtime.evaluation.rules import stated_rules
    from pe_runtime.evaluation.tables import as_json

    info, folders = read_dataset(data)
    wanted = fitting_tables(tabled.table or ALL, tabled.runs, model, device(), info.views)
    measured = {}
    for table in wanted:
        rows = contenders_of(table, tabled.runs, model, device())
        with progress(table) as report:
            measured[table] = measure_rows(rows, data, table, instruments, limit, report)
    report = {
        "scene": info.scene,
        "sequences": len(folders[:limit]),
        "detector": instruments.detector_name,
        "protocol": stated_rules(),
        "tables": measured,
    }
    if tabled.out is not None:
        write_report(report, tabled.out)
        for row in contenders_of(wanted[0], tabled.runs, model, device()):
            folder = tabled.out / row.name if tabled.runs is not None else tabled.out
            _write_sheets(row.load(), data, folder)
    views = []
    for table, rows in measured.items():
        views += [as_rich(table, rows, f"{info.scene}: {table}"), *notes(table, rows), ""]
    show(json.loads(as_json(report)), Group(*views))


def _write_sheets(environment: Any, data: Path, folder: Path) -> None:  # noqa: ANN401
    from pe_runtime.contract.episode import read_dataset, read_episode
    from pe_runtime.evaluation.sheets import write_sheets

    _, folders = read_dataset(data)
    for path in write_sheets(environment, [read_episode(each) for each in folders[:7]], folder):
        note(f"sheet: {path}")
