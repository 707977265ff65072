"""Record a data set by several Blender processes at once; resumable, cancellable.

The recording itself is `python -m blender_addon.datagen`; this module splits the sequences over
such processes and watches them. It needs no Blender in its own interpreter.
"""

import os
import queue
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO

from pe_runtime.contract.episode import (
    DATASET_FILE,
    DatasetInfo,
    episode_path,
    is_complete,
    read_dataset,
    read_info,
    write_dataset,
)
from pe_runtime.contract.errors import EpisodeError
from pe_runtime.contract.scenes import BUILT_IN_SCENES

NO_BLENDER = 3  # exit status of the recorder where `bpy` cannot be imported
Progress = Callable[[int, int], None]

_CHUNKS_PER_PROCESS = 4  # starting Blender costs as much as a few frames: not one per episode
_LONGEST_CHUNK = 25
_TAIL_LINES = 15
_POLL_SECONDS = 0.2
_STOP_SECONDS = 5.0


@dataclass(frozen=True)
class RecordingJob:
    """What to record.

    Attributes:
        scene: A built-in scene's name (`contract.scenes`), or the path of a .blend file whose
            objects are marked playable.
        sequences: Number of episodes of the data set; a .blend file is one episode.
        seed: With the episode's number it decides everything random.
        size: Pixel columns and rows.
        output: Folder of the data set.
        views: Cameras to record.
        samples: Cycles samples per ray; 1 is exact for the built-in scenes.
        frames: Of each episode; None for the scene's own number.
    """

    scene: str
    sequences: int
    seed: int
    size: tuple[int, int]
    output: Path
    views: int = 1
    samples: int = 1
    frames: int | None = None

    def __post_init__(self) -> None:
        numbers = {"sequences": self.sequences, "views": self.views, "samples": self.samples}
        numbers |= {} if self.frames is None else {"frames": self.frames}
        numbers |= {"width": self.size[0], "height": self.size[1]}
        for name, value in numbers.items():
            if value < 1:
                raise EpisodeError(f"recording: {name} is {value}; expected 1 or more")
        if self.scene in BUILT_IN_SCENES:
            return
        if not Path(self.scene).is_file():
            raise EpisodeError(
                f"scene {self.scene} does not exist; give a .blend file or one of "
                f"{', '.join(BUILT_IN_SCENES)}"
            )
        if self.sequences != 1:
            raise EpisodeError(
                f"scene {self.scene}: a .blend file is one episode, {self.sequences} were asked "
                "for; record it with 1 sequence"
            )


def record(
    job: RecordingJob,
    processes: int | None = None,
    python: str = sys.executable,
    on_progress: Progress | None = None,
) -> DatasetInfo:
    """Record what is missing of a data set and return what it holds.

    Complete episodes are kept, half-written ones redone. A data set may be enlarged by recording
    it again with more sequences.

    Args:
        job: What to record, and where to.
        processes: Blender processes at once; the number of cores by default.
        python: Interpreter with `bpy` and this package.
        on_progress: Called with the episodes complete so far and their final number.

    Raises:
        EpisodeError: If the folder holds another recording, `bpy` is missing, or a process fails.
    """
    _join_existing(job)
    numbers = range(job.sequences)
    missing = [n for n in numbers if not is_complete(episode_path(job.output, n))]
    processes = processes or os.cpu_count() or 1
    report = on_progress or _ignore_progress
    report(job.sequences - len(missing), job.sequences)
    if missing:
        job.output.mkdir(parents=True, exist_ok=True)
        crew = _Crew(job, python, split(missing, processes))
        done = job.sequences - len(missing)
        try:
            for finished in crew.run(processes):
                report(done + finished, job.sequences)
        finally:
            crew.stop()
    return read_dataset(job.output)[0]


def split(missing: list[int], processes: int) -> list[range]:
    """Cut episode numbers (ascending) into consecutive ranges, several for each process."""
    length = -(-len(missing) // (processes * _CHUNKS_PER_PROCESS))
    length = min(max(length, 1), _LONGEST_CHUNK)
    chunks: list[range] = []
    for number in missing:
        last = chunks[-1] if chunks else range(0)
        if len(last) in range(1, length) and last.stop == number:
            chunks[-1] = range(last.start, number + 1)
        else:
            chunks.append(range(number, number + 1))
    return chunks


def _ignore_progress(done: int, total: int) -> None:
    """The default listener."""


def _join_existing(job: RecordingJob) -> None:
    """Refuse a folder with another recording; enlarge the same one if more is asked for."""
    if not (job.output / DATASET_FILE).is_file():
        return
    found = read_info(job.output)
    name = job.scene if job.scene in BUILT_IN_SCENES else Path(job.scene).stem
    asked = {"scene": name, "seed": job.seed, "views": job.views}
    asked |= {"width": job.size[0], "height": job.size[1]}
    other = {
        key: getattr(found, key) for key, value in asked.items() if getattr(found, key) != value
    }
    if other:
        wanted = {key: asked[key] for key in other}
        raise EpisodeError(
            f"{job.output} holds another recording: {other} instead of {wanted}; choose another "
            "folder, or record with the same options"
        )
    if job.sequences > found.count:
        write_dataset(job.output, replace(found, count=job.sequences))


@dataclass(eq=False)
class _Worker:
    """One running Blender process and the episodes it was given."""

    process: subprocess.Popen
    chunk: range
    errors: IO[bytes]


@dataclass
class _Crew:
    """The processes of one recording and the chunks that still wait for one."""

    job: RecordingJob
    python: str
    waiting: list[range]
    workers: list[_Worker] = field(default_factory=list)
    # (worker, True) for each finished episode, (worker, False) when its output ends
    news: queue.SimpleQueue = field(default_factory=queue.SimpleQueue)

    def run(self, processes: int) -> Iterator[int]:
        """Work off all chunks; yields the number of episodes finished so far."""
        count = 0
        while self.waiting or self.workers:
            while self.waiting and len(self.workers) < processes:
                self._start(self.waiting.pop(0))
            try:
                worker, episode_finished = self.news.get(timeout=_POLL_SECONDS)
            except queue.Empty:  # the timeout lets Ctrl-C through on every platform
                continue
            if episode_finished:
                count += 1
                yield count
            else:
                self._dismiss(worker)

    def stop(self) -> None:
        """End every process that still runs; its half-written episode is redone next time."""
        for worker in self.workers:
            worker.process.terminate()
        for worker in self.workers:
            try:
                worker.process.wait(_STOP_SECONDS)
            except subprocess.TimeoutExpired:
                worker.process.kill()
                worker.process.wait()
            worker.errors.close()
        self.workers.clear()

    def _start(self, chunk: range) -> None:
        errors = tempfile.TemporaryFile()
        try:
            process = subprocess.Popen(
                [self.python, "-m", "blender_addon.datagen", *_options(self.job, chunk)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=errors,
                env=_environment(),
                # Ctrl-C in a terminal must reach this process alone: Blender would swallow it.
                start_new_session=True,
            )
        except OSError as error:
            errors.close()
            raise EpisodeError(
                f"cannot start {self.python}: {error}; give the Python that has `bpy`"
            ) from error
        worker = _Worker(process, chunk, errors)
        self.workers.append(worker)
        threading.Thread(target=self._listen, args=(worker,), daemon=True).start()

    def _listen(self, worker: _Worker) -> None:
        with worker.process.stdout as replies:
            for line in replies:
                if line.startswith(b'{"episode"'):
                    self.news.put((worker, True))
        self.news.put((worker, False))

    def _dismiss(self, worker: _Worker) -> None:
        """Take leave of a process that has ended.

        Raises:
            EpisodeError: If it failed, or left episodes unfinished.
        """
        status = worker.process.wait()
        messages = _tail(worker.errors)
        if "ModuleNotFoundError" in messages or status == NO_BLENDER:
            raise EpisodeError(
                f"{self.python} cannot record: {messages.splitlines()[-1]}; give a Python that has "
                "Blender's wheel, or add it: pip install 'playable-environments[blender]'"
            )
        paths = [episode_path(self.job.output, n) for n in worker.chunk]
        unfinished = [path.name for path in paths if not is_complete(path)]
        if status or unfinished:
            raise EpisodeError(
                f"recording of episodes {paths[0].name} to {paths[-1].name} failed with status "
                f"{status}, {len(unfinished)} unfinished; the end of its messages:\n"
                f"{messages}"
            )
        self.workers.remove(worker)
        worker.errors.close()


def _options(job: RecordingJob, chunk: range) -> list[str]:
    width, height = job.size
    options = {
        "--scene": job.scene,
        "--count": job.sequences,
        "--seed": job.seed,
        "--size": f"{width}x{height}",
        "--views": job.views,
        "--samples": job.samples,
        "--output": job.output,
    }
    if job.frames is not None:
        options["--frames"] = job.frames
    flat = [str(word) for pair in options.items() for word in pair]
    return [*flat, "--sequence-range", str(chunk.start), str(chunk.stop)]


def _environment() -> dict[str, str]:
    """This process's environment; a source checkout is made importable for the child."""
    environment = dict(os.environ)
    root = Path(__file__).resolve().parents[1]
    if (root / "pyproject.toml").is_file():
        paths = [str(root), environment.get("PYTHONPATH", "")]
        environment["PYTHONPATH"] = os.pathsep.join(path for path in paths if path)
    return environment


def _tail(errors: IO[bytes]) -> str:
    errors.seek(0)
    lines = errors.read().decode("utf-8", "replace").strip().splitlines()
    return "\n".join(lines[-_TAIL_LINES:]) or "(it said nothing)"
