"""The training loop: one for every phase.

A phase is anything that can do a step and hand its tensors over; the loop counts, logs, saves and
resumes. Randomness is seeded anew from the step's number, so a resumed run repeats the very steps
that an uninterrupted one would have made.
"""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Float
from torch import Tensor

from pe_runtime.contract.errors import PlayableEnvironmentError
from pe_runtime.training.interruption import finishing_on_signal
from pe_runtime.training.processes import Log, Team
from pe_runtime.training.run_folder import CHECKPOINT, CURVES, METRICS, SAMPLES, RunFolder

__all__ = [
    "CHECKPOINT",
    "CURVES",
    "METRICS",
    "SAMPLES",
    "BrokenStepError",
    "Log",
    "Moment",
    "Phase",
    "Pictured",
    "Schedule",
    "TrainingError",
    "learning_rate_share",
    "optimiser_tensors",
    "restore_optimiser",
    "run",
]
STAIRS = 30
"""Steps in which the release of 2022 lowers its learning rates: 300,000 / 10,000."""


class TrainingError(PlayableEnvironmentError):
    """Training cannot go on: the loss is not finite, or another run's folder is in the way."""


class BrokenStepError(PlayableEnvironmentError):
    """A step whose loss or gradient is not finite, found before it changed a weight.

    Args:
        figures: What the step measured.
        evidence: Its batch, to be stored.
    """

    def __init__(self, figures: Log, evidence: Mapping[str, Tensor]) -> None:
        super().__init__(f"{', '.join(_not_finite(figures))} is not finite")
        self.figures, self.evidence = figures, evidence


@runtime_checkable
class Phase(Protocol):
    """What the loop trains."""

    def step(self, progress: float) -> Log:
        """Make one optimisation step at a point of the schedule in [0, 1); returns figures.

        All processes of a team return the same figures.
        """

    def evaluate(self) -> Log:
        """Measure on held-out data; may return nothing. Only the leader of a team is asked."""

    def tensors(self) -> dict[str, Tensor]:
        """Everything that a resumed run needs: weights, optimiser, running statistics."""

    def restore(self, tensors: Mapping[str, Tensor]) -> None:
        """Take back what `tensors` gave."""


@runtime_checkable
class Pictured(Protocol):
    """A phase that can show what it measured."""

    def sheet(self) -> Float[Tensor, "rows columns 3"] | None:
        """A picture in [0, 1] of the last measurement."""


@dataclass(frozen=True)
class Schedule:
    """How long a run lasts and when it stops to look.

    Attributes:
        steps: Optimisation steps in all.
        minutes: Wall-clock limit; the schedule is stretched over whichever ends first.
        log_every: Steps between log lines.
        evaluate_every: Steps between measurements; 0 for none.
        checkpoint_every: Steps between checkpoints.
        seed: Seed of all randomness.
    """

    steps: int
    minutes: float | None = None
    log_every: int = 20
    evaluate_every: int = 0
    checkpoint_every: int = 250
    seed: int = 0

    def progress(self, step: int, elapsed: float) -> float:
        """Where in the schedule a run is, 1 at its end.

        Args:
            step: Steps made.
            elapsed: Seconds spent.
        """
        share = step / self.steps if self.steps else 1.0
        return max(share, elapsed / (60 * self.minutes)) if self.minutes else share


@dataclass(frozen=True)
class Moment:
    """Where a run is after a step.

    Attributes:
        step: Steps made.
        steps: Steps to be made, unless the time ends first.
        progress: Share of the schedule, in [0, 1] or a little over.
        figures: Of the step alone.
    """

    step: int
    steps: int
    progress: float
    figures: Log


def run(
    phase: Phase,
    output: str | Path,
    schedule: Schedule,
    resume: bool = False,
    on_log: Callable[[int, Log], None] | None = None,
    on_step: Callable[[Moment], None] | None = None,
) -> int:
    """Train a phase; Ctrl-C or SIGTERM ends it after the current step, saved.

    Under `torchrun` every process calls this; a signal at any of them ends all, and only the first
    writes and tells.

    Args:
        phase: What is trained.
        output: Run folder: checkpoint.safetensors, metrics.jsonl (one JSON object a line),
            curves.png and, of phases that have them, samples.
        schedule: Length and rhythm.
        resume: Go on from the folder's checkpoint.
        on_log: Called with the step and its figures whenever a line is logged.
        on_step: Called after every step.

    Returns:
        The number of steps made in all.

    Raises:
        TrainingError: The loss is not finite (the last checkpoint is kept), or the folder holds
            another run.
        CheckpointError: `resume` without a checkpoint.
    """
    team = Team.current()
    folder = RunFolder(output, team.leads)
    if not resume and folder.in_use:
        raise TrainingError(
            f"{output} holds another run; go on with it (resume), or give another folder"
        )
    step, elapsed = _resumed(phase, folder) if resume else (0, 0.0)
    team.wait()
    started = time.monotonic() - elapsed
    since: list[Log] = []
    with finishing_on_signal() as wish:
        while step < schedule.steps:
            # Clocks and signals differ between processes; what they do next must not.
            stop, progress = team.largest(float(wish.is_set()), schedule.progress(step, elapsed))
            if stop or progress >= 1:
                break
            torch.manual_seed(schedule.seed * 1_000_003 + step)
            since.append(_checked_step(phase, progress, (step, schedule.seed), folder))
            step += 1
            elapsed = time.monotonic() - started
            if team.leads:
                if on_step:
                    now = schedule.progress(step, elapsed)
                    on_step(Moment(step, schedule.steps, now, since[-1]))
                _pause(phase, folder, schedule, (step, elapsed, since), on_log)
    folder.save(phase.tensors(), step, elapsed)
    folder.draw_curves()
    team.wait()
    return step


def learning_rate_share(
    progress: float, warmup: float = 0.0, rates: str = "cosine", last: float = 0.1
) -> float:
    """Share of the learning rate at a point of the training.

    Args:
        progress: The point, in [0, 1].
        warmup: Share of the training over which it rises linearly.
        rates: How it goes on: a half "cosine" down to zero, "exponential" to `last`, the same in
            "stairs", or "constant".
        last: Where "exponential" and "stairs" end.
    """
    if progress < warmup:
        return (progress + 1e-9) / warmup
    done = (progress - warmup) / (1 - warmup) if warmup < 1 else 1.0
    if rates == "constant":
        return 1.0
    if rates == "exponential":
        return last**done
    if rates == "stairs":
        return last ** (math.floor(done * STAIRS + 1e-9) / STAIRS)
    return 0.5 * (1 + math.cos(math.pi * done))


def optimiser_tensors(optimiser: torch.optim.Optimizer, prefix: str) -> dict[str, Tensor]:
    """Adam's moments and step counts as flat named tensors."""
    state = optimiser.state_dict()["state"]
    return {
        f"{prefix}.{index}.{name}": torch.as_tensor(value)
        for index, values in state.items()
        for name, value in values.items()
    }


def restore_optimiser(
    optimiser: torch.optim.Optimizer, tensors: Mapping[str, Tensor], prefix: str
) -> None:
    """Take back what `optimiser_tensors` gave."""
    state: dict[int, dict[str, Tensor]] = {}
    for name, tensor in tensors.items():
        if name.startswith(prefix + "."):
            index, key = name[len(prefix) + 1 :].split(".")
            state.setdefault(int(index), {})[key] = tensor
    groups = optimiser.state_dict()["param_groups"]
    optimiser.load_state_dict({"state": state, "param_groups": groups})


def _checked_step(phase: Phase, progress: float, which: tuple[int, int], folder: RunFolder) -> Log:
    """One step, whose figures are finite.

    Args:
        phase: What is trained.
        progress: Point of the schedule.
        which: Number of the step, and the run's seed.
        folder: Where the batch goes if it breaks the run.
    """
    step, seed = which
    try:
        figures = phase.step(progress)
    except BrokenStepError as broken:
        told = {name: str(value) for name, value in broken.figures.items()}
        facts = {"seed": seed, "progress": progress, "figures": told}
        path = folder.keep_evidence(broken.evidence, step, facts)
        raise TrainingError(
            f"step {step}: {broken}. Its batch is in {path}, and it has not touched the weights. "
            + _advice(folder)
        ) from broken
    bad = _not_finite(figures)
    if bad:
        raise TrainingError(f"step {step}: {', '.join(bad)} is not finite. {_advice(folder)}")
    return figures


def _advice(folder: RunFolder) -> str:
    return (
        f"The last checkpoint in {folder.path} is from before; resume it with a lower learning "
        "rate or another seed."
    )


def _not_finite(figures: Log) -> list[str]:
    return [name for name, value in figures.items() if not math.isfinite(value)]


def _pause(
    phase: Phase,
    folder: RunFolder,
    schedule: Schedule,
    now: tuple[int, float, list[Log]],
    on_log: Callable[[int, Log], None] | None,
) -> None:
    """Log, measure and save when it is time to."""
    step, elapsed, since = now
    figures: Log = {}
    if step % schedule.log_every == 0 or step == schedule.steps:
        figures = {k: sum(f[k] for f in since) / len(since) for k in since[-1]}
        since.clear()
    measured = schedule.evaluate_every and step % schedule.evaluate_every == 0
    if measured:
        figures |= phase.evaluate()
    if figures:
        figures["minutes"] = elapsed / 60
        folder.note(step, figures)
        if on_log:
            on_log(step, figures)
    if measured:
        folder.show(step, phase.sheet() if isinstance(phase, Pictured) else None)
        folder.draw_curves()
    if step % schedule.checkpoint_every == 0:
        folder.save(phase.tensors(), step, elapsed)


def _resumed(phase: Phase, folder: RunFolder) -> tuple[int, float]:
    tensors, step, spent = folder.load()
    phase.restore(tensors)
    folder.forget_after(step)
    return step, spent
