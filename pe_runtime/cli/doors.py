"""`pe demo` and `pe worker`: other programs behind a command."""

from pathlib import Path
from typing import Annotated

import typer

from pe_runtime.cli.pictures import DEFAULT_MODEL, Model
from pe_runtime.cli.terminal import device, parse_size, progress, show


def demo(
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for all the demo makes.")],
    model: Model = DEFAULT_MODEL,
    actions: Annotated[
        str | None, typer.Option(help="Other actions: player_1=left*5,back*4;player_2=idle*9")
    ] = None,
    size: Annotated[str | None, typer.Option(help="Pixels; default: the picture's.")] = None,
    quality: Annotated[str, typer.Option(help="exact, balanced or draft.")] = "exact",
    clip: Annotated[Path | None, typer.Option(help="Another clip to start from.")] = None,
    passing_cube: Annotated[
        bool, typer.Option("--passing-cube", help="The example of compositing instead.")
    ] = False,
) -> None:
    """From one picture to a filmed strip: encode, key, bake, render, cut."""
    from pe_runtime.demo import DemoOptions, run_demo, run_passing_cube

    pixels = None if size is None else parse_size(size)
    options = DemoOptions(model, actions, pixels, quality, clip, device())
    if passing_cube:
        with progress("frames") as report_progress:
            made = run_passing_cube(out, options, report_progress)
        show(made, f"{out}: open {made['contact_sheet']} or {made['blend']}")
        return
    with progress("frames") as report_progress:
        report = run_demo(out, options, report_progress)
    show(report, _summary(out, report))


def worker(
    fake: Annotated[bool, typer.Option("--fake", help="A moving gradient, without torch.")] = False,
    device: Annotated[str, typer.Option(help="auto, cpu or cuda.")] = "auto",
) -> None:
    """Serve a model to Blender over stdin and stdout."""
    from pe_runtime.worker.process import run_worker

    raise typer.Exit(run_worker(fake=fake, device=device))


def _summary(out: Path, report: dict) -> str:
    seconds = ", ".join(f"{name} {value:.1f}" for name, value in report["seconds"].items())
    return (
        f"{out}: {report['frames']} frames, {report['frames_per_second']:.2f} a second\n"
        f"seconds: {seconds}\n"
        f"the first picture comes back at {report['psnr_of_first_frame']:.1f} dB\n"
        f"open {out / 'contact_sheet.png'}, {report['video']} or {report['blend']}"
    )
