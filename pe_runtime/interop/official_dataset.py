"""Data sets of the authors' release as ours: ROOT/{train,val,test}/SEQUENCE/CAMERA -> episodes.

One data set is written for each split. An episode is written under another name and renamed when
it is complete, so that an import may be killed at any time and begun again: what is there stays.
"""

import shutil
from collections.abc import Iterator
from concurrent.futures import FIRST_EXCEPTION, Executor, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from pe_runtime.contract.episode import (
    DATASET_FILE,
    DatasetInfo,
    EpisodeArrays,
    episode_path,
    frame_path,
    read_dataset,
    read_episode,
    write_dataset,
    write_episode,
)
from pe_runtime.contract.errors import EpisodeError
from pe_runtime.interop.dataset_arrays import Terms, episode_arrays, part_of
from pe_runtime.interop.dataset_extras import readable
from pe_runtime.interop.dataset_folders import camera_folders, picture_paths
from pe_runtime.interop.dataset_pictures import import_picture
from pe_runtime.interop.dataset_plan import (
    ImportOptions,
    ImportPlan,
    Progress,
    Skipped,
    Source,
    SplitPlan,
    plan_import,
    read_views,
    taken,
)
from pe_runtime.interop.dataset_report import ImportReport, report_split

PART = ".importing"
"""Where an episode lies until it is complete."""
SAME = 1e-5
"""Relative and absolute difference of numbers that are the same."""


def import_dataset(
    root: str | Path,
    output: str | Path,
    options: ImportOptions | None = None,
    on_progress: Progress | None = None,
) -> ImportReport:
    """Import a data set of the release, or one split of it.

    Complete episodes of an earlier import are kept, if they are the same.

    Args:
        root: Folder with train, val and test, or one of them.
        output: Our data set, or the folder of ours; not within `root`.
        options: How to import it.
        on_progress: Called with the episodes done and their number.

    Raises:
        EpisodeError: Nothing can be imported, `output` holds another data set, or, if strict, a
            sequence cannot be imported.
    """
    return carry_out(plan_import(Path(root), options or ImportOptions()), Path(output), on_progress)


def carry_out(plan: ImportPlan, output: Path, on_progress: Progress | None = None) -> ImportReport:
    """Write what was planned; see `import_dataset`."""
    if output.resolve().is_relative_to(plan.root.resolve()):
        raise EpisodeError(f"{output} lies within {plan.root}, which is read; write elsewhere")
    jobs = [_SplitImport(plan, split, output / split.name) for split in plan.splits]
    for job in jobs:
        job.look_for_existing()
    done = 0
    with ThreadPoolExecutor() as pool:
        for job in jobs:
            for _ in job.run(pool):
                done += 1
                if on_progress:
                    on_progress(done, plan.episodes)
    return ImportReport(
        plan.world.name,
        plan.told_by,
        plan.world.up,
        plan.focal_multiplier,
        plan.steps_per_second,
        "{}x{}".format(*plan.options.size),
        tuple(
            report_split(
                plan, job.split, str(job.folder), (len(job.existing), job.kept), job.skipped
            )
            for job in jobs
        ),
    )


@dataclass(frozen=True, eq=False)
class _Draft:
    """An episode to be written: its numbers and, by view and frame, its pictures."""

    arrays: EpisodeArrays
    pictures: list[list[Path]]
    metadata: dict[str, Any]

    @property
    def key(self) -> tuple[str, int]:
        """Where it comes from: sequence and first frame."""
        return self.metadata["sequence"], self.metadata["first_frame"]

    @property
    def frames(self) -> str:
        """Which part of the sequence it is."""
        return f"frames from {self.metadata['first_frame']:05d} on"


@dataclass
class _SplitImport:
    """The writing of one split.

    Attributes:
        plan: The import.
        split: What becomes of this split.
        folder: Our data set.
        described: What its `dataset.json` says.
        existing: Its complete episodes, by sequence and first frame.
        kept: How many of the planned episodes an earlier import had made.
        skipped: What could not be written after all.
        number: Where to look for the next free number.
    """

    plan: ImportPlan
    split: SplitPlan
    folder: Path
    described: DatasetInfo | None = None
    existing: dict[tuple[str, int], Path] = field(default_factory=dict)
    kept: int = 0
    skipped: list[Skipped] = field(default_factory=list)
    number: int = 0

    @property
    def info(self) -> DatasetInfo:
        """What `dataset.json` will say."""
        cameras, players = self.split.sources[0].shape
        skip = self.plan.options.skip
        return DatasetInfo(
            scene=self.plan.world.name,
            seed=0,
            count=sum(len(self.split.starts(each, skip)) for each in self.split.sources),
            steps_per_second=self.plan.steps_per_second,
            width=self.plan.options.size[0],
            height=self.plan.options.size[1],
            objects=tuple(f"player_{number + 1}" for number in range(players)),
            actions=(),
            views=cameras,
        )

    def look_for_existing(self) -> None:
        """Find the complete episodes of an earlier import.

        Raises:
            EpisodeError: The folder holds another data set.
        """
        if not (self.folder / DATASET_FILE).is_file():
            return
        found, episodes = read_dataset(self.folder)
        self.described = found
        if replace(found, count=self.info.count) != self.info:
            raise EpisodeError(
                f"{self.folder} holds another data set: {found}, this one is {self.info}; choose "
                "another folder, or import with the same options"
            )
        for path in episodes:
            metadata = read_episode(path).metadata
            key = (str(metadata.get("sequence")), int(metadata.get("first_frame", -1)))
            self.existing[key] = path

    def run(self, pool: Executor) -> Iterator[None]:
        """Write what is missing; yields after each planned episode, written or not."""
        with _tidied(self.folder):
            for source in self.split.sources:
                for draft in self._drafts(source):
                    if draft is not None:
                        self._finish(draft, pool)
                    yield
            if self.existing:
                self._describe(replace(self.info, count=len(self.existing)))
        if not self.existing:
            first = self.skipped[0]
            raise EpisodeError(
                f"no episode of {self.plan.root / self.split.name} could be written; "
                f"{first.sequence}: {first.reason}"
            )

    def _drafts(self, source: Source) -> Iterator[_Draft | None]:
        """The episodes of a sequence; None for each where it has changed since it was planned."""
        options = self.plan.options
        starts, rows = self.split.starts(source, options.skip), taken(source, options.skip)
        try:
            views = read_views(source.folder)
            if len(views[0].boxes) != source.pictures:
                raise EpisodeError("its pictures changed while it was imported")
            pictures = [picture_paths(each) for each in camera_folders(source.folder)]
        except EpisodeError as error:
            self._skip(source.name, str(error))
            yield from (None for _ in starts)
            return
        terms = Terms(
            self.plan.world.up, self.plan.focal_multiplier, options.size, self.split.knows_actions
        )
        arrays = episode_arrays(views, rows, terms)
        for start in starts:
            chosen = rows[start : start + self.split.frames]
            yield _Draft(
                part_of(arrays, start, self.split.frames),
                [[paths[frame] for frame in chosen] for paths in pictures],
                {
                    "sequence": source.name,
                    "first_frame": chosen[0],
                    "frames_skipped": options.skip,
                    "positions": "object poses" if source.located else "boxes on the ground",
                    **readable(views[0].extras, chosen),
                },
            )

    def _finish(self, draft: _Draft, pool: Executor) -> None:
        """Keep an episode that is there, or write it."""
        if draft.key in self.existing:
            _check_same(self.existing[draft.key], draft.arrays)
            self.kept += 1
            return
        try:
            self.existing[draft.key] = self._write(draft, pool)
        except EpisodeError as error:
            self._skip(draft.key[0], f"{draft.frames}: {error}")

    def _write(self, draft: _Draft, pool: Executor) -> Path:
        part = self.folder / PART
        shutil.rmtree(part, ignore_errors=True)
        size, tasks = self.plan.options.size, []
        for view, pictures in enumerate(draft.pictures):
            frame_path(part, view, 0).parent.mkdir(parents=True)
            for frame, picture in enumerate(pictures):
                target = frame_path(part, view, frame)
                tasks.append(pool.submit(import_picture, picture, target, size))
        try:
            wait(tasks, return_when=FIRST_EXCEPTION)
            for task in tasks:
                task.result()
        finally:
            # Whoever clears up after a failure must be the last to touch the folder.
            for task in tasks:
                task.cancel()
            wait(tasks)
        write_episode(part, self.info, draft.arrays, draft.metadata)
        self._describe(self.info)
        while episode_path(self.folder, self.number).exists():
            self.number += 1
        return part.rename(episode_path(self.folder, self.number))

    def _describe(self, info: DatasetInfo) -> None:
        if info != self.described:
            write_dataset(self.folder, info)
            self.described = info

    def _skip(self, sequence: str, reason: str) -> None:
        if self.plan.options.strict:
            raise EpisodeError(f"{self.plan.root / self.split.name / sequence}: {reason}")
        self.skipped.append(Skipped(sequence, reason, damaged=True))


def _check_same(path: Path, arrays: EpisodeArrays) -> None:
    stored = read_episode(path).arrays
    pairs = {name: (found, getattr(arrays, name)) for name, found in vars(stored).items()}
    other = [
        name
        for name, (found, wanted) in pairs.items()
        # Not to the last bit, which may depend on the machine.
        if found.shape != wanted.shape or not np.allclose(found, wanted, SAME, SAME, equal_nan=True)
    ]
    if other:
        raise EpisodeError(
            f"{path} is from another import: its {', '.join(other)} differ; choose another "
            "folder, or import with the same options"
        )


@contextmanager
def _tidied(folder: Path) -> Iterator[None]:
    """Leave neither half an episode behind nor folders that nothing was put into."""
    new = [each for each in (folder, *folder.parents) if not each.exists()]
    try:
        yield
    finally:
        shutil.rmtree(folder / PART, ignore_errors=True)
        for each in new:
            if each.is_dir() and not any(each.iterdir()):
                each.rmdir()
