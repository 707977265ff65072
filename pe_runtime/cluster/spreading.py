"""The client's part: hand out runs of frames, write what comes back, try again what does not."""

import queue
import time
import uuid
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import torch
from distributed import Future
from distributed.scheduler import KilledWorker

from pe_runtime.cluster.connection import Connection, Place, connect
from pe_runtime.cluster.drawing import endings, versions
from pe_runtime.cluster.model_copies import ModelCopy, file_digest
from pe_runtime.cluster.parcels import Answer, Files, FrameOrder, Job, pack, read_answer
from pe_runtime.cluster.runs import split_into_runs
from pe_runtime.cluster.tasks import draw_run
from pe_runtime.contract.errors import ClusterError
from pe_runtime.images import read_metadata
from pe_runtime.shots.files import DIGEST_KEY, FramePlan, RenderReport, frame_path
from pe_runtime.shots.frames import (
    OnProgress,
    RenderCancelledError,
    ShouldStop,
    frame_state,
    render_options,
)

ATTEMPTS = 3
"""Workers on which a frame may fail, each in its turn, before the job does."""
POLL_SECONDS = 0.1
PRESENCE_SECONDS = 1.0
LONELY_SECONDS = 60.0
"""How long a job waits for a first or a new worker."""


@dataclass(frozen=True)
class ModelFile:
    """The model that draws: its file, and the device it runs on ("auto", "cpu" or "cuda")."""

    path: Path
    device: str = "auto"


def draw_on_cluster(
    place: Place,
    plan: FramePlan,
    model: ModelFile,
    on_progress: OnProgress | None = None,
    should_stop: ShouldStop | None = None,
) -> RenderReport:
    """Draw the missing frames of a plan; the files are those that one machine would write.

    Args:
        place: Which workers.
        plan: The shot, rolled out, and its folder.
        model: What draws.
        on_progress: Called after every frame with the number done and the total.
        should_stop: Asked several times a second; files written so far stay.

    Raises:
        ClusterError: The cluster is out of reach, or a frame fails wherever it is tried.
        RenderCancelledError: `should_stop` said so.
    """
    if plan.missing:
        gpu = model.device != "cpu" and torch.cuda.is_available()
        with connect(place, len(plan.missing), gpu) as connection:
            dispatch = Dispatch(connection, plan, model)
            arriving = dispatch.frames(should_stop or (lambda: False))
            for done, (number, files) in enumerate(arriving, start=len(plan.kept) + 1):
                _put(plan, number, files)
                if on_progress is not None:
                    on_progress(done, len(plan.digests))
    return RenderReport(plan.missing, plan.kept, time.perf_counter() - plan.began)


class Dispatch:
    """The runs that are out with the workers, and what became of the others.

    Args:
        connection: The cluster.
        plan: What to draw.
        model: With what.
    """

    def __init__(self, connection: Connection, plan: FramePlan, model: ModelFile) -> None:
        self.connection = connection
        self.client = connection.client
        self.plan = plan
        self.model = model
        options = render_options(plan.prepared.shot)
        self.job = Job(
            versions=versions(),
            model=str(model.path.absolute()),
            model_digest=file_digest(model.path),
            device=model.device,
            quality=plan.prepared.shot.quality,
            depth=options.depth,
            masks=options.masks,
            region=options.region,
            layers=options.layers,
            background=options.background,
            threads=connection.threads,
        )
        self._out: dict[Future, tuple[int, ...]] = {}
        self._back: queue.SimpleQueue[Future] = queue.SimpleQueue()
        self._failures: dict[int, list[tuple[str, str]]] = defaultdict(list)
        self._suspects: set[int] = set()
        self._alone: tuple[int, ...] = ()
        self._lacked_model: set[int] = set()
        self._copy: ModelCopy | None = None
        self._last_seen = time.monotonic()

    def frames(self, should_stop: ShouldStop) -> Iterator[tuple[int, Files]]:
        """Draw the plan's missing frames.

        Yields:
            Frame number and contents of its files, as they come.
        """
        left = set(self.plan.missing)
        try:
            for run in split_into_runs(self.plan.missing, max(1, self.connection.workers)):
                self._send(run)
            while self._out or self._suspects:
                if not self._out:
                    self._alone = (self._suspects.pop(),)
                    self._send(self._alone)
                future = self._next(should_stop, left)
                run = self._out.pop(future)
                answer = self._settle(future, run)
                for number, files in answer.drawn.items():
                    left.remove(number)
                    yield number, files
                self._ask_again(answer, run)
        finally:
            self._clean_up()

    def _send(self, run: Sequence[int], avoid: Sequence[str] = (), priority: int = 0) -> None:
        """Ask for a run, if it can be, of workers other than those to avoid."""
        parcel = pack(self.job, [self._order(number) for number in run])
        others = [each for each in self.client.nthreads() if each not in avoid] if avoid else []
        future = self.client.submit(
            draw_run,
            parcel,
            key=f"draw-{run[0]}-{run[-1]}-{uuid.uuid4().hex}",
            workers=others or None,
            allow_other_workers=bool(others),
            priority=priority,
        )
        self._out[future] = tuple(run)
        future.add_done_callback(self._back.put)

    def _order(self, number: int) -> FrameOrder:
        prepared = self.plan.prepared
        state, camera = frame_state(prepared, number), prepared.shot.camera_at(number)
        return FrameOrder(number, self.plan.digests[number], state, camera)

    def _next(self, should_stop: ShouldStop, left: set[int]) -> Future:
        """The next run that came back, one way or another."""
        while True:
            if should_stop():
                total = len(self.plan.missing)
                raise RenderCancelledError(f"cancelled after {total - len(left)} of {total} frames")
            try:
                return self._back.get(timeout=POLL_SECONDS)
            except queue.Empty:
                self._check_presence()

    def _check_presence(self) -> None:
        now = time.monotonic()
        if now - self._last_seen < PRESENCE_SECONDS:
            return
        with suppress(OSError):
            if self.client.status == "running" and self.connection.workers:
                self._last_seen = now
        if now - self._last_seen > LONELY_SECONDS:
            raise ClusterError(
                f"no worker at {self._address} for {LONELY_SECONDS:.0f} s; start some with "
                "`dask worker`, then the same command draws the frames that are missing"
            )

    def _settle(self, future: Future, run: tuple[int, ...]) -> Answer:
        """What came of a run that is back.

        Raises:
            ClusterError: The scheduler, the workers or one of the frames is beyond help.
        """
        if future.cancelled():
            raise ClusterError(
                f"the scheduler at {self._address} went away; the frames that are there stay, "
                "and the same command draws the others"
            )
        problem = future.exception()
        if isinstance(problem, KilledWorker):
            return self._suspect(run)
        if problem is not None:
            raise ClusterError(
                f"the workers cannot draw ({type(problem).__name__}: {problem}); install "
                "playable-environments[cluster] where the scheduler and the workers run"
            )
        answer = read_answer(future.result(), run, endings(self.job))
        future.release()
        return self._bring_model(answer, run) if answer.needs_model else answer

    def _ask_again(self, answer: Answer, run: tuple[int, ...]) -> None:
        """Ask for the frames of a run that are not there.

        Raises:
            ClusterError: One of them has failed often enough.
        """
        asked = {*answer.drawn, *self._suspects, answer.failed}
        rest = tuple(number for number in run if number not in asked)
        # Ahead of runs that nobody has begun.
        if rest:
            self._send(rest, priority=1)
        if answer.failed is not None:
            failures = self._failures[answer.failed]
            failures.append((answer.worker, answer.problem))
            if len(failures) >= min(ATTEMPTS, max(1, self.connection.workers)):
                where = ", ".join(worker for worker, _ in failures)
                raise ClusterError(
                    f"frame {answer.failed} cannot be drawn (tried by {where}): {answer.problem}"
                )
            self._send((answer.failed,), [worker for worker, _ in failures], priority=2)

    def _suspect(self, run: tuple[int, ...]) -> Answer:
        """Put the frames of a run off that was with several workers when they ended.

        Other runs may have been with them, so each frame is tried again with nothing else around.
        """
        if run == self._alone:
            raise ClusterError(
                f"frame {run[0]} ended one worker process after the other; most likely their "
                "memory is too small for it: start fewer workers on each machine"
            )
        self._suspects.update(run)
        return Answer("")

    def _bring_model(self, answer: Answer, run: tuple[int, ...]) -> Answer:
        """Send the model to all workers, once; who then still lacks it has failed."""
        if not self._lacked_model.isdisjoint(run):
            return Answer(answer.worker, failed=run[0], problem="the model's file does not arrive")
        self._lacked_model.update(run)
        if self._copy is None:
            self._copy = ModelCopy(self.model.path.read_bytes(), self.job.model_digest)
            self.client.register_plugin(self._copy)
        return answer

    def _clean_up(self) -> None:
        if self.client.status != "running":
            return
        # A scheduler that goes away now needs no cleaning.
        with suppress(OSError):
            self.client.cancel(list(self._out), force=True)
            if self._copy is not None:
                self.client.unregister_worker_plugin(self._copy.name)

    @property
    def _address(self) -> str:
        return self.client.scheduler.address if self.client.scheduler else "the cluster"


def _put(plan: FramePlan, number: int, files: Files) -> None:
    """Move a frame's files into place, each whole or not at all.

    Raises:
        ClusterError: A file is not that of this frame.
    """
    for ending, content in files.items():
        path = frame_path(plan.folder, number).with_suffix(ending)
        unfinished = path.with_name(f".{path.stem}.{uuid.uuid4().hex}{ending}")
        try:
            unfinished.write_bytes(content)
            if read_metadata(unfinished).get(DIGEST_KEY) != plan.digests[number]:
                raise ClusterError(f"{path}: what came from the cluster is not this frame")
            unfinished.replace(path)
        finally:
            unfinished.unlink(missing_ok=True)
