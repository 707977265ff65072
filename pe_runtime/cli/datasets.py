"""`pe dataset`: training data."""

from pathlib import Path
from typing import Annotated

import typer

from pe_runtime.cli.terminal import parse_size, progress, shared, show

app = typer.Typer(help="Record training data, and say what a data set holds.")
Folder = Annotated[Path, typer.Argument(help="The data set's folder.")]


@app.command()
@shared
def record(
    output: Annotated[Path, typer.Option("--out", "-o", help="Folder of the data set.")],
    sequences: Annotated[int, typer.Option(min=1, help="Number of episodes.")],
    scene: Annotated[str, typer.Option(help="duel, or a .blend file with playable objects.")] = (
        "duel"
    ),
    seed: Annotated[int, typer.Option(help="Decides everything random.")] = 0,
    size: Annotated[str, typer.Option(help="Pixels.")] = "256x144",
    views: Annotated[int, typer.Option(min=1, max=2, help="Cameras to record.")] = 1,
    processes: Annotated[
        int | None, typer.Option(min=1, help="Blenders at once; default: one per core.")
    ] = None,
) -> None:
    """Let Blender record episodes; complete ones are kept, so it may be interrupted."""
    from pe_runtime.recording import RecordingJob
    from pe_runtime.recording import record as record_episodes

    job = RecordingJob(scene, sequences, seed, parse_size(size), output, views)
    with progress("episodes") as report:
        record_episodes(job, processes, on_progress=report)
    _tell(output)


@app.command()
@shared
def info(dataset: Folder) -> None:
    """Say what a data set holds."""
    _tell(dataset)


def _tell(dataset: Path) -> None:
    from pe_runtime.contract.episode import read_dataset, read_episode

    facts, folders = read_dataset(dataset)
    lengths = [read_episode(folder).arrays.frames for folder in folders]
    show(
        {
            "folder": str(dataset),
            "scene": facts.scene,
            "seed": facts.seed,
            "complete_episodes": len(folders),
            "episodes": facts.count,
            "frames": sum(lengths) * facts.views,
            "size": f"{facts.width}x{facts.height}",
            "views": facts.views,
            "steps_per_second": facts.steps_per_second,
            "objects": list(facts.objects),
            "actions": list(facts.actions),
        }
    )
