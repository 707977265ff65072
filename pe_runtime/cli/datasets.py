"""`pe dataset`: training data."""

import dataclasses
import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.text import Text

from pe_runtime.cli.terminal import parse_size, progress, shared, show
from pe_runtime.contract.errors import EpisodeError

app = typer.Typer(help="Record or import training data, and say what a data set holds.")
Folder = Annotated[Path, typer.Argument(help="The data set's folder.")]


@app.command()
@shared
def record(
    output: Annotated[Path, typer.Option("--out", "-o", help="Folder of the data set.")],
    sequences: Annotated[int, typer.Option(min=1, help="Number of episodes.")],
    scene: Annotated[
        str, typer.Option(help="duel, court, static-court, or a .blend file with playable objects.")
    ] = ("duel"),
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


@dataclasses.dataclass(frozen=True)
class ImportChoices:
    """The options of `pe dataset import-official`."""

    world: Annotated[
        str | None, typer.Option(help="tennis or minecraft; default: told from the cameras.")
    ] = None
    focal_multiplier: Annotated[
        float | None,
        typer.Option(
            help="From stored focal lengths to pixels of 512x288; default: tennis 0.51417, "
            "minecraft 0.5."
        ),
    ] = None
    steps_per_second: Annotated[
        float | None,
        typer.Option(help="Of the episodes; default: tennis 5, minecraft 25, divided by skip + 1."),
    ] = None
    size: Annotated[str, typer.Option(help="Pixels of the episodes.")] = "512x288"
    skip: Annotated[int, typer.Option(min=0, help="Frames left out after each taken.")] = 0
    frames: Annotated[
        int | None,
        typer.Option(
            min=2,
            help="Cut sequences into episodes of so many frames; default: whole sequences if all "
            "are of one length, else 16.",
        ),
    ] = None
    split: Annotated[
        str | None, typer.Option(help="Which of train,val,test; default: those there are.")
    ] = None
    strict: Annotated[
        bool, typer.Option("--strict", help="Write nothing if a sequence cannot be imported.")
    ] = False


def _choosing(kind: type) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the fields of a dataclass as options; it gets them as `choices`."""
    names = [each.name for each in dataclasses.fields(kind)]

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(command)
        def run(**given: Any) -> None:  # noqa: ANN401
            chosen = kind(**{name: given.pop(name) for name in names})
            command(**given, choices=chosen)

        own = dict(inspect.signature(command).parameters)
        del own["choices"]
        parameters = [*own.values(), *inspect.signature(kind).parameters.values()]
        # Typer reads the signature and the annotations to build the options.
        run.__signature__ = inspect.Signature(
            [each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in parameters]
        )
        run.__annotations__ = {each.name: each.annotation for each in parameters}
        return run

    return decorate


@app.command()
@shared
@_choosing(ImportChoices)
def import_official(
    root: Annotated[Path, typer.Argument(help="Folder with train, val and test, or one of them.")],
    output: Annotated[Path, typer.Option("--out", "-o", help="Folder of our data set(s).")],
    choices: ImportChoices,
) -> None:
    """Read a data set of the authors' release; complete episodes are kept, so it may be killed.

    What can be imported is, and the rest reported; if some of it is damaged, the exit status is 1.
    """
    from pe_runtime.interop.dataset_plan import ImportOptions, plan_import
    from pe_runtime.interop.official_dataset import carry_out

    chosen = dataclasses.asdict(choices)
    chosen |= {"size": parse_size(choices.size), "splits": _splits(chosen.pop("split"))}
    options = ImportOptions(**chosen)
    with progress("sequences read") as report:
        plan = plan_import(root, options, report)
    with progress("episodes") as report:
        done = carry_out(plan, output, report)
    show(done.as_dict(), Text(done.as_text()))
    if done.damaged:
        split, first = done.damaged[0]
        raise EpisodeError(
            f"{len(done.damaged)} sequence(s) of {root} could not be imported whole, the first is "
            f"{split}{'/' if split else ''}{first.sequence}: {first.reason}"
        )


def _splits(text: str | None) -> tuple[str, ...] | None:
    return None if text is None else tuple(each.strip() for each in text.split(","))


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
