"""What an import did, in numbers and reasons: nothing is left out or made up in silence."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from pe_runtime.interop.dataset_plan import ImportPlan, Skipped, Source, SplitPlan, taken

LISTED = 10
"""Skipped sequences that the text names; all are in the JSON."""


@dataclass(frozen=True)
class SplitReport:
    """What became of a split.

    Attributes:
        split: train, val or test; "" where the data set has no splits.
        folder: Our data set.
        sequences: Sequences found.
        imported: Sequences of which an episode was made.
        episodes: Episodes of our data set.
        kept: How many of them an earlier import had made.
        frames: Frames of an episode.
        cameras: Cameras of an episode.
        players: Players of an episode.
        left_out_frames: Frames after the last whole episode of a sequence.
        lost_boxes: Boxes that were said to be valid but are NaN, empty or out of the picture.
        actions: "known", or "unknown" where there are none or all are the same.
        positions: What told them: "object_poses.pkl", "boxes", or both for different sequences.
        defaulted: Missing pickles, and in how many sequences.
        notes: What else was left aside, and in how many sequences.
        unread: Files that are not imported, and in how many sequences.
        skipped: Sequences, or parts of them, that were left out, and why.
    """

    split: str
    folder: str
    sequences: int
    imported: int
    episodes: int
    kept: int
    frames: int
    cameras: int
    players: int
    left_out_frames: int
    lost_boxes: int
    actions: str
    positions: str
    defaulted: dict[str, int]
    notes: dict[str, int]
    unread: dict[str, int]
    skipped: tuple[Skipped, ...]


@dataclass(frozen=True)
class ImportReport:
    """What an import did.

    Attributes:
        world: "tennis" or "minecraft".
        told_by: "cameras" or "--world".
        up: Up axis of that world; ours is z.
        focal_multiplier: From stored focal lengths to pixels of 512x288.
        steps_per_second: Of the episodes.
        size: Of the episodes, as 512x288.
        splits: Split by split.
    """

    world: str
    told_by: str
    up: str
    focal_multiplier: float
    steps_per_second: float
    size: str
    splits: tuple[SplitReport, ...]

    @property
    def damaged(self) -> list[tuple[str, Skipped]]:
        """Splits and sequences that should have been imported and could not."""
        return [(s.split, each) for s in self.splits for each in s.skipped if each.damaged]

    def as_dict(self) -> dict[str, Any]:
        """The report as JSON can hold it."""
        return asdict(self)

    def as_text(self) -> str:
        """The report as lines to read."""
        lines = [
            f"world: {self.world}, told by {self.told_by} ({self.up} up)",
            f"episodes: {self.size}, {self.steps_per_second:g} steps a second, focal lengths "
            f"times {self.focal_multiplier:g}",
        ]
        return "\n".join(lines + [line for each in self.splits for line in _lines(each)])


def report_split(
    plan: ImportPlan,
    split: SplitPlan,
    folder: str,
    counts: tuple[int, int],
    skipped: Iterable[Skipped],
) -> SplitReport:
    """Sum up a split.

    Args:
        plan: The import.
        split: The split's part of it.
        folder: Our data set.
        counts: Episodes in it, and those kept of them.
        skipped: What was left out while writing.
    """
    sources, every = split.sources, tuple(skipped)
    lengths = [len(taken(each, plan.options.skip)) for each in sources]
    cameras, players = sources[0].shape
    lost = {each.sequence for each in every}
    return SplitReport(
        split=split.name,
        folder=folder,
        sequences=len({each.name for each in sources} | {s.sequence for s in split.skipped}),
        imported=sum(each.name not in lost for each in sources),
        episodes=counts[0],
        kept=counts[1],
        frames=split.frames,
        cameras=cameras,
        players=players,
        left_out_frames=sum(length % split.frames for length in lengths),
        lost_boxes=sum(each.lost_boxes for each in sources),
        actions="known" if split.knows_actions else "unknown",
        positions=_positions(sources),
        defaulted=_counted(each.defaulted for each in sources),
        notes=_counted(each.notes for each in sources),
        unread=_counted(each.unread for each in sources),
        skipped=(*split.skipped, *every),
    )


def _positions(sources: Sequence[Source]) -> str:
    told = sorted({"object_poses.pkl" if each.located else "boxes" for each in sources})
    return " and ".join(told)


def _counted(names: Iterable[Iterable[str]]) -> dict[str, int]:
    return dict(sorted(Counter(name for each in names for name in each).items()))


def _lines(split: SplitReport) -> Iterable[str]:
    yield (
        f"{split.folder}: {split.episodes} episodes of {split.frames} frames ({split.kept} were "
        f"there) from {split.imported} of {split.sequences} sequences; {split.cameras} camera(s), "
        f"{split.players} player(s)"
    )
    yield f"  actions: {split.actions}; positions: by {split.positions}"
    if split.left_out_frames:
        yield f"  left out: {split.left_out_frames} frames after the last whole episode"
    if split.lost_boxes:
        yield f"  boxes taken for absent: {split.lost_boxes} (NaN, empty or out of the picture)"
    for label, counts in (
        ("missing, done without", split.defaulted),
        ("left aside", split.notes),
        ("not imported", split.unread),
    ):
        if counts:
            told = ", ".join(f"{name} ({count}x)" for name, count in counts.items())
            yield f"  {label}: {told}"
    for each in split.skipped[:LISTED]:
        yield f"  skipped {each.sequence}: {each.reason}"
    if len(split.skipped) > LISTED:
        yield f"  and {len(split.skipped) - LISTED} more; --json names all"
