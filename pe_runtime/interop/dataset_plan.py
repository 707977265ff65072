"""What of a data set of the release can be imported, decided before anything is written."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pe_runtime.contract.errors import EpisodeError
from pe_runtime.interop.conventions import FOCAL_MULTIPLIERS
from pe_runtime.interop.dataset_annotations import UNKNOWN, Annotations, read_annotations
from pe_runtime.interop.dataset_folders import (
    camera_folders,
    find_splits,
    picture_paths,
    sequence_folders,
    unread_names,
)
from pe_runtime.interop.dataset_worlds import World, choose_world, world_seen

CLIP_FRAMES = 16
"""Length of the release's own clips for validation and test."""
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class ImportOptions:
    """How a data set is imported.

    Attributes:
        world: "tennis" or "minecraft"; by default the cameras tell.
        focal_multiplier: From stored focal lengths to pixels of 512x288; default: the world's.
        steps_per_second: Of the episodes; default: the world's rate divided by skip + 1.
        size: Pixel columns and rows of the episodes.
        skip: Frames left out after each that is taken.
        frames: Length of an episode; default: whole sequences where all are of one length, else
            CLIP_FRAMES, or the shortest sequence's where none has as many.
        splits: Which of train, val and test; default: those there are.
        strict: Whether a sequence that cannot be imported is an error.
    """

    world: str | None = None
    focal_multiplier: float | None = None
    steps_per_second: float | None = None
    size: tuple[int, int] = (512, 288)
    skip: int = 0
    frames: int | None = None
    splits: tuple[str, ...] | None = None
    strict: bool = False

    def __post_init__(self) -> None:
        for name, lowest in (("skip", 0), ("frames", 2)):
            value = getattr(self, name)
            if value is not None and value < lowest:
                raise EpisodeError(f"import: {name} is {value}; expected {lowest} or more")
        for name in ("focal_multiplier", "steps_per_second"):
            value = getattr(self, name)
            if value is not None and not 0 < value < np.inf:
                raise EpisodeError(f"import: {name} is {value}; expected a number above 0")


@dataclass(frozen=True)
class Source:
    """What is known of a sequence of the release that can be read.

    Attributes:
        name: Its folder's name.
        folder: Where it lies.
        pictures: Frames of each of its cameras.
        shape: Cameras and players.
        world: The world that its cameras show, if they tell.
        actions: The different actions in it.
        lost_boxes: Boxes that are said to be valid but are NaN, empty or out of the picture.
        located: Whether it tells where its players are.
        defaulted: Pickles it does without.
        notes: What is left aside of its pickles, and why.
        unreadable: Why some of what is kept for people to read is not.
        unread: Names of files that are not imported.
    """

    name: str
    folder: Path
    pictures: int
    shape: tuple[int, int]
    world: str | None
    actions: frozenset[int]
    lost_boxes: int
    located: bool
    defaulted: tuple[str, ...]
    notes: tuple[str, ...]
    unreadable: tuple[str, ...]
    unread: frozenset[str]


@dataclass(frozen=True)
class Skipped:
    """A sequence, or a part of one, that is not imported; `damaged` if it should have been."""

    sequence: str
    reason: str
    damaged: bool


@dataclass(frozen=True)
class SplitPlan:
    """What becomes of a split.

    Attributes:
        name: train, val or test; "" where the data set has no splits.
        sources: Sequences to import.
        skipped: Sequences left out.
        frames: Length of its episodes.
        knows_actions: Whether its actions say anything.
    """

    name: str
    sources: tuple[Source, ...]
    skipped: tuple[Skipped, ...]
    frames: int
    knows_actions: bool

    def starts(self, source: Source, skip: int) -> range:
        """First frames, among those taken, of the episodes that a sequence becomes."""
        return range(0, len(taken(source, skip)) - self.frames + 1, self.frames)


@dataclass(frozen=True)
class ImportPlan:
    """What is imported, and how."""

    root: Path
    world: World
    told_by: str
    options: ImportOptions
    splits: tuple[SplitPlan, ...]

    @property
    def focal_multiplier(self) -> float:
        """From stored focal lengths to pixels of 512x288."""
        return self.options.focal_multiplier or FOCAL_MULTIPLIERS[self.world.name]

    @property
    def steps_per_second(self) -> float:
        """Of the episodes."""
        rate = self.world.frames_per_second / (self.options.skip + 1)
        return self.options.steps_per_second or rate

    @property
    def episodes(self) -> int:
        """Number of episodes of all splits."""
        skip = self.options.skip
        return sum(len(split.starts(s, skip)) for split in self.splits for s in split.sources)


def taken(source: Source, skip: int) -> range:
    """Frames of a sequence that are taken."""
    return range(0, source.pictures, skip + 1)


def read_views(folder: Path) -> list[Annotations]:
    """The annotations of every camera of a sequence.

    Raises:
        EpisodeError: It cannot be imported.
    """
    cameras = camera_folders(folder)
    lengths = {camera.name: len(picture_paths(camera)) for camera in cameras}
    if len(set(lengths.values())) > 1:
        raise EpisodeError(f"its cameras have different numbers of pictures: {lengths}")
    views = [read_annotations(camera, lengths[camera.name]) for camera in cameras]
    players = {view.boxes.shape[1] for view in views}
    if len(players) > 1:
        raise EpisodeError(f"its cameras see different numbers of players: {sorted(players)}")
    return views


def plan_import(
    root: Path, options: ImportOptions, on_progress: Progress | None = None
) -> ImportPlan:
    """Read all annotations of a data set and decide what becomes of them; nothing is written.

    Args:
        root: Folder of the data set, or of one split.
        options: How to import it.
        on_progress: Called with the sequences read and their number.

    Raises:
        EpisodeError: There is no such data set, nothing of a split can be used, it shows another
            world than it should, or, if strict, a sequence cannot be imported.
    """
    folders = {
        name: sequence_folders(split) for name, split in find_splits(root, options.splits).items()
    }
    total, done = sum(map(len, folders.values())), 0
    read: dict[str, list[Source | Skipped]] = {}
    for name, sequences in folders.items():
        read[name] = []
        for sequence in sequences:
            read[name].append(_survey(sequence))
            done += 1
            if on_progress:
                on_progress(done, total)
    sound = {name: _sound(root / name, each) for name, each in read.items()}
    seen = {str(s.folder): s.world for sources in sound.values() for s in sources}
    world, told_by = choose_world(seen, options.world)
    splits = tuple(_plan_split(root, name, read[name], world, options) for name in read)
    if options.strict:
        _check_nothing_skipped(splits)
    return ImportPlan(root, world, told_by, options, splits)


def _survey(folder: Path) -> Source | Skipped:
    try:
        views = read_views(folder)
    except EpisodeError as error:
        return Skipped(folder.name, str(error), damaged=True)
    first = views[0]
    cameras = camera_folders(folder)
    return Source(
        folder.name,
        folder,
        len(first.boxes),
        (len(views), first.boxes.shape[1]),
        world_seen(first.angles, first.translations),
        frozenset() if first.actions is None else frozenset(first.actions.tolist()),
        sum(int((view.valid & ~view.present).sum()) for view in views),
        first.positions is not None,
        tuple(dict.fromkeys(name for view in views for name in view.defaulted)),
        tuple(dict.fromkeys(note for view in views for note in view.notes)),
        tuple(reason for view in views for reason in view.unreadable),
        frozenset().union(*(unread_names(each, picture_paths(each)) for each in cameras)),
    )


def _sound(split: Path, read: Sequence[Source | Skipped]) -> list[Source]:
    sources = [each for each in read if isinstance(each, Source)]
    if not sources:
        raise EpisodeError(_nothing_usable(split, read))
    return sources


def _plan_split(
    root: Path,
    name: str,
    read: Sequence[Source | Skipped],
    world: World,
    options: ImportOptions,
) -> SplitPlan:
    sources = [each for each in read if isinstance(each, Source)]
    skipped = [each for each in read if isinstance(each, Skipped)]
    shape = _usual(each.shape for each in sources if each.world in (None, world.name))
    frames = options.frames or _length([len(taken(each, options.skip)) for each in sources])
    usable = []
    for each in sources:
        reason, damaged = _misfit(each, world, shape), True
        if reason is None and len(taken(each, options.skip)) < frames:
            reason, damaged = _too_short(each, frames, options.skip), False
        if reason is None:
            usable.append(each)
        else:
            skipped.append(Skipped(each.name, reason, damaged))
    skipped += [Skipped(s.name, _without(why), True) for s in usable for why in s.unreadable]
    skipped.sort(key=lambda each: each.sequence)
    if not usable:
        raise EpisodeError(_nothing_usable(root / name, skipped))
    # A recorder that knows no actions fills the list with one number.
    actions = frozenset().union(*(each.actions for each in usable)) - {UNKNOWN}
    return SplitPlan(name, tuple(usable), tuple(skipped), frames, len(actions) > 1)


def _misfit(source: Source, world: World, shape: tuple[int, int] | None) -> str | None:
    """Why a sequence does not belong to the others."""
    if source.world not in (None, world.name):
        return f"its cameras are {source.world}'s, the data set is {world.name}"
    if source.shape != shape:
        return f"it has {_told(source.shape)}, most have {_told(shape)}"
    return None


def _without(reason: str) -> str:
    return f"imported without an annotation that the program has no use for: {reason}"


def _told(shape: tuple[int, int] | None) -> str:
    return "{} camera(s) and {} player(s)".format(*shape or (0, 0))


def _too_short(source: Source, frames: int, skip: int) -> str:
    left = f", {len(taken(source, skip))} with skip {skip}" if skip else ""
    return f"it has {source.pictures} frames{left}; an episode has {frames}"


def _usual(shapes: Iterable[tuple[int, int]]) -> tuple[int, int] | None:
    counted = Counter(shapes).most_common(1)
    return counted[0][0] if counted else None


def _length(lengths: Sequence[int]) -> int:
    """Frames of an episode where the user does not say."""
    long_enough = [each for each in lengths if each >= 2] or [2]
    if len(set(long_enough)) == 1 or max(long_enough) < CLIP_FRAMES:
        return min(long_enough)
    return CLIP_FRAMES


def _check_nothing_skipped(splits: Sequence[SplitPlan]) -> None:
    skipped = [(split.name, each) for split in splits for each in split.skipped]
    if skipped:
        name, first = skipped[0]
        raise EpisodeError(
            f"{len(skipped)} sequence(s) cannot be imported whole, the first is "
            f"{name}{'/' if name else ''}{first.sequence}: {first.reason}; without --strict the "
            "others are"
        )


def _nothing_usable(split: Path, read: Iterable[Source | Skipped]) -> str:
    reasons = [f"{each.sequence}: {each.reason}" for each in read if isinstance(each, Skipped)]
    return f"{split} has no sequence that can be used ({len(reasons)} found); {reasons[0]}"
