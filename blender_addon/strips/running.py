"""A job from its first look at the scene to the last file in its place, as a generator.

It yields its progress whenever a window wants its turn and never keeps anything of Blender across
one. Closing it early gives everything back that it has lent or made.
"""

import time
from collections.abc import Callable, Generator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from bpy.app.translations import pgettext_iface as iface_

from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.model_facts import ModelFacts

from ..filming.pace import duration_in_words
from ..polls import rendering
from ..worker.background import BackgroundCall
from .arrivals import Arrivals
from .job import RangeJob, file_name, source_of
from .lending import lent_settings
from .plan import Plan, plan_job
from .staging import staging_folder
from .wish import read_takes, wish_of

IDLE_TURNS = 20
"""Turns without a render job after which it counts as ended."""
Begin = Callable[[str], bool]
"""Has Blender render a scene's range, named; returns whether that goes on in the background."""


@dataclass(frozen=True)
class Progress:
    """How far a job is.

    Attributes:
        text: What it does.
        share: How much of that is done, in [0, 1].
        renders: Whether Blender renders, so that Esc is Blender's.
    """

    text: str
    share: float = 0.0
    renders: bool = False


@dataclass(frozen=True)
class Outcome:
    """How a job ended.

    Attributes:
        drawn: Frames that were drawn and are in place.
        count: Frames of the job.
        facts: The model that draws them.
        stopped: Whether the artist stopped it; frames are missing or old then.
        warnings: What the artist should know.
    """

    drawn: int
    count: int
    facts: ModelFacts
    stopped: bool = False
    warnings: tuple[str, ...] = ()

    def in_words(self) -> str:
        """A sentence for the status bar."""
        if self.stopped:
            return f"Stopped after {self.drawn} frames, which are kept; render again to go on"
        kept = self.count - self.drawn
        return f"{self.drawn} frames rendered" + (f", {kept} were up to date" if kept else "")


Running = Generator[Progress, None, Outcome]
shown_progress: dict[str, Progress] = {}
"""Of the jobs that are under way in a window, by their id; for panels."""


def run_job(
    job: RangeJob, begin: Begin, everything: bool = False, overwrite: bool = False
) -> Running:
    """Do a job; see the module.

    Args:
        job: What is rendered, and where to.
        begin: Starts Blender's own rendering.
        everything: Draw frames too that are up to date.
        overwrite: Replace files too that this job has not written.

    Raises:
        PlayableEnvironmentError: Scene, folder, model or worker are at fault. Frames that were
            finished before are in place.
        RuntimeError: Blender's own rendering failed.
    """
    takes = []
    for some in read_takes(job):
        takes += some
        yield Progress("Reading the scene", len(takes) / len(job.frames))
    wish = wish_of(job, takes, everything, overwrite)
    plan: Plan = yield from _waiting(BackgroundCall(partial(plan_job, wish)))
    if not plan.drawn:
        return Outcome(0, len(job.frames), plan.facts, warnings=plan.warnings)
    with staging_folder(job.folder) as staged, Arrivals(job, plan, staged) as arrivals:
        try:
            yield from _drawing(job, plan, arrivals, staged, begin)
        except RuntimeError as error:
            raise (ShotError(arrivals.fault) if arrivals.fault else error) from error
    if arrivals.fault:
        raise ShotError(arrivals.fault)
    complete = len(arrivals.placed) == len(plan.drawn)
    if not complete and not arrivals.cancelled:
        raise ShotError(f"Blender saved {len(arrivals.placed)} of {len(plan.drawn)} frames")
    placed = len(arrivals.placed)
    return Outcome(placed, len(job.frames), plan.facts, not complete, plan.warnings)


def _waiting(call: BackgroundCall) -> Generator[Progress, None, object]:
    try:
        while not call.done:
            yield Progress(call.stage or "Starting", call.progress)
        return call.result()
    finally:
        call.cancel()


def _drawing(
    job: RangeJob, plan: Plan, arrivals: Arrivals, staged: Path, begin: Begin
) -> Generator[Progress, None, None]:
    """Have Blender draw; the lent settings are given back before the files count."""
    first, last = plan.drawn[0], plan.drawn[-1]
    part = RangeJob(job.scene_name, job.folder, first, last, job.id)
    scene, began = source_of(job), time.monotonic()
    with lent_settings(scene, part, staged):
        gaps = set(part.frames) - set(plan.drawn)
        # Blender skips files that exist: in one go it draws several runs of frames.
        for frame in gaps:
            (staged / file_name(frame)).touch()
        scene.render.use_overwrite = not gaps
        in_background, idle = begin(scene.name), 0
        while in_background and idle <= IDLE_TURNS:
            done, count = len(arrivals.placed), len(plan.drawn)
            left = time_left(time.monotonic() - began, done, count)
            said = iface_("Frame {number} of {count}").format(
                number=min(done + 1, count), count=count
            )
            yield Progress(f"{said}{left}", done / count, True)
            # What Blender ends without a word, as it does for an undo, is over too.
            idle = 0 if rendering() else idle + 1
            in_background = not arrivals.ended or idle == 0
        arrivals.cancelled |= not arrivals.ended and idle > IDLE_TURNS


def time_left(spent: float, done: int, count: int) -> str:
    """How long the rest will take, to go on a sentence; empty before the first frame is done."""
    if not done:
        return ""
    duration = duration_in_words(spent / done * (count - done))
    return iface_(", about {duration} left").format(duration=duration)
