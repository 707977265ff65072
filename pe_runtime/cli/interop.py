"""`pe import-official`: the checkpoints that the paper's authors published."""

from pathlib import Path
from typing import Annotated

import typer

from pe_runtime.cli.terminal import show


def import_official(
    files: Annotated[
        list[Path], typer.Argument(help="A stage-2 checkpoint, a stage-3 checkpoint, or both.")
    ],
    output: Annotated[Path, typer.Option("--out", "-o", help="Model file to write.")],
    world: Annotated[
        str | None, typer.Option(help="tennis or minecraft; default: as the weights say.")
    ] = None,
) -> None:
    """Turn the authors' checkpoints (.pth.tar) into one model file."""
    from pe_runtime.interop.official_checkpoint import import_official as convert

    report = convert(files, output, world)
    result = {
        "model": str(report.path),
        "bytes": report.path.stat().st_size,
        "world": report.world,
        "files": dict(report.files),
        "entries": report.entries,
        "actions": {name: list(each) for name, each in report.actions.items()},
        "same_environment": report.same_environment,
    }
    lines = [f"{output}: the {report.world} model, {report.entries} entries"]
    for name, actions in report.actions.items():
        lines.append(f"actions of {name}: {', '.join(actions)}")
    if not report.actions:
        lines.append("it has no actions: give the stage-3 checkpoint as well to play it")
    if report.same_environment is False:
        lines.append("the stage-3 file was trained with another environment than this stage-2 file")
    lines.append("the weights' licence does not allow commercial use")
    show(result, "\n".join(lines))
