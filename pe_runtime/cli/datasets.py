"""`pe dataset`: training data."""

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text

from pe_runtime.cli.option_groups import grouped
from pe_runtime.cli.terminal import parse_size, progress, shared, show
from pe_runtime.contract.errors import EpisodeError
from pe_runtime.contract.scenes import BUILT_IN_SCENES
from pe_runtime.curation.splits import SEED_OFFSETS, parse_splits, split_folders

if TYPE_CHECKING:
    from pe_runtime.recording import RecordingJob

app = typer.Typer(help="Record, import or disturb training data, and say what a data set holds.")
Folder = Annotated[Path, typer.Argument(help="The data set's folder.")]


@dataclasses.dataclass(frozen=True)
class RecordChoices:
    """The options of `pe dataset record`."""

    sequences: Annotated[
        int | None, typer.Option(min=1, help="Number of episodes of one data set.")
    ] = None
    splits: Annotated[
        str | None,
        typer.Option(
            help="Record parts instead, such as train=80,val=8,test=16; their seeds are --seed "
            "plus 1, 2 and 3."
        ),
    ] = None
    seed: Annotated[int, typer.Option(help="Decides everything random.")] = 0
    size: Annotated[str, typer.Option(help="Pixels.")] = "256x144"
    views: Annotated[
        int | None,
        typer.Option(
            min=1, max=2, help="Cameras to record; default: the scene's, and 2 for val and test."
        ),
    ] = None
    frames: Annotated[
        int | None, typer.Option(min=2, help="Of each episode; default: the scene's, 12.")
    ] = None
    processes: Annotated[
        int | None, typer.Option(min=1, help="Blenders at once; default: one per core.")
    ] = None


@dataclasses.dataclass(frozen=True)
class NoiseChoices:
    """The options of `pe dataset disturb`."""

    camera_degrees: Annotated[
        float, typer.Option(min=0, help="Rotation of the camera, about each axis.")
    ] = 0.2
    camera_metres: Annotated[
        float, typer.Option(min=0, help="Place of the camera, along each axis.")
    ] = 0.05
    focal: Annotated[float, typer.Option(min=0, help="Focal length, as a share of it.")] = 0.005
    box_pixels: Annotated[float, typer.Option(min=0, help="Each edge of a box.")] = 1.0
    outliers: Annotated[
        float, typer.Option(min=0, max=1, help="Share of boxes that are off by up to a third.")
    ] = 0.02
    dropout: Annotated[
        float, typer.Option(min=0, max=1, help="Share of boxes that are missing.")
    ] = 0.05


@app.command()
@shared
@grouped
def record(
    output: Annotated[Path, typer.Option("--out", "-o", help="Folder of the data set.")],
    scene: Annotated[
        str, typer.Option(help=f"{', '.join(BUILT_IN_SCENES)}, or a .blend file.")
    ] = "duel",
    *,
    choices: RecordChoices,
) -> None:
    """Let Blender record episodes; complete ones are kept, so it may be interrupted."""
    from pe_runtime.recording import record as record_episodes

    for split, job in _recording_jobs(output, scene, choices).items():
        with progress(f"{split} episodes".strip()) as report:
            record_episodes(job, choices.processes, on_progress=report)
    _tell(output)


@app.command()
@shared
def info(
    dataset: Folder,
    sheet: Annotated[
        Path | None, typer.Option(help="Also write a contact sheet with boxes, a PNG.")
    ] = None,
) -> None:
    """Say what a data set holds, or each of its parts train, val and test."""
    if sheet is not None:
        from pe_runtime.curation.sheet import write_dataset_sheet

        write_dataset_sheet(split_folders(dataset), sheet)
    _tell(dataset)


@app.command()
@shared
@grouped
def disturb(
    dataset: Folder,
    output: Annotated[Path, typer.Option("--out", "-o", help="Folder of the noisy copy.")],
    seed: Annotated[int, typer.Option(help="Decides the noise.")] = 0,
    *,
    choices: NoiseChoices,
) -> None:
    """Copy a data set with noise on its cameras and boxes, given as standard deviations.

    The pictures are the same files where the disk allows it; the true cameras and boxes stay
    beside the noisy ones.
    """
    from pe_runtime.curation.disturbing import disturb_dataset
    from pe_runtime.curation.noise import Noise

    noise = Noise(**dataclasses.asdict(choices))
    for split, folder in split_folders(dataset).items():
        with progress(f"{split} episodes".strip()) as report:
            disturb_dataset(folder, output / split, noise, seed, report)
    _tell(output)


@app.command()
@shared
def shrink(
    dataset: Folder,
    output: Annotated[Path, typer.Option("--out", "-o", help="Folder of the small copy.")],
    factor: Annotated[int, typer.Option(min=2, help="Pixels that become one, each way.")] = 2,
) -> None:
    """Copy a data set with smaller pictures, for comparisons of many trainings."""
    from pe_runtime.curation.shrinking import shrink_dataset

    for split, folder in split_folders(dataset).items():
        with progress(f"{split} episodes".strip()) as report:
            shrink_dataset(folder, output / split, factor, report)
    _tell(output)


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


@app.command()
@shared
@grouped
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


def _recording_jobs(output: Path, scene: str, choices: RecordChoices) -> "dict[str, RecordingJob]":
    """What to record, by the name of the split; "" for a single data set."""
    from pe_runtime.recording import RecordingJob

    if (choices.sequences is None) == (choices.splits is None):
        raise EpisodeError(
            "recording: give either --sequences 100 or --splits train=80,val=8,test=16"
        )
    size, usual = parse_size(choices.size), BUILT_IN_SCENES.get(scene, 1)
    if choices.splits is None:
        views = choices.views or usual
        job = RecordingJob(scene, choices.sequences, choices.seed, size, output, views)
        return {"": dataclasses.replace(job, frames=choices.frames)}
    jobs = {}
    for split, count in parse_splits(choices.splits).items():
        # A second view is the ground truth of novel views; training never looks at it.
        views = choices.views or (usual if split == "train" else 2)
        seed = choices.seed + SEED_OFFSETS[split]
        job = RecordingJob(scene, count, seed, size, output / split, views)
        jobs[split] = dataclasses.replace(job, frames=choices.frames)
    return jobs


def _tell(dataset: Path) -> None:
    from pe_runtime.cli.dataset_table import as_facts_table
    from pe_runtime.curation.facts import read_facts

    facts = {split: read_facts(folder) for split, folder in split_folders(dataset).items()}
    told = {split: each.as_dict() for split, each in facts.items()}
    result = told[""] if "" in told else {"splits": told}
    show({"folder": str(dataset), **result}, as_facts_table(str(dataset), facts))
