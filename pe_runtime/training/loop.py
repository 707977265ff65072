"""The training loop: one for every phase.

A phase is anything that can do a step and hand its tensors over; the loop counts, logs, saves and
resumes. Randomness is seeded anew from the step's number, so a resumed run repeats the very steps
that an uninterrupted one would have made.
"""

import contextlib
import json
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import torch
from torch import Tensor

from pe_runtime.checkpoint import load_checkpoint, save_checkpoint
from pe_runtime.contract.errors import CheckpointError, PlayableEnvironmentError

Log = dict[str, float]
CHECKPOINT = "checkpoint.safetensors"
METRICS = "metrics.jsonl"


class TrainingError(PlayableEnvironmentError):
    """Training cannot go on: the loss is not finite, or another run's folder is in the way."""


@runtime_checkable
class Phase(Protocol):
    """What the loop trains."""

    def step(self, progress: float) -> Log:
        """Make one optimisation step at a point of the schedule in [0, 1); returns figures."""

    def evaluate(self) -> Log:
        """Measure on held-out data; may return nothing."""

    def tensors(self) -> dict[str, Tensor]:
        """Everything that a resumed run needs: weights, optimiser, running statistics."""

    def restore(self, tensors: Mapping[str, Tensor]) -> None:
        """Take back what `tensors` gave."""


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


def run(
    phase: Phase,
    output: str | Path,
    schedule: Schedule,
    resume: bool = False,
    on_log: Callable[[int, Log], None] | None = None,
) -> int:
    """Train a phase; Ctrl-C or SIGTERM ends it after the current step, saved.

    Args:
        phase: What is trained.
        output: Run folder: checkpoint.safetensors and metrics.jsonl (one JSON object a line).
        schedule: Length and rhythm.
        resume: Go on from the folder's checkpoint.
        on_log: Called with the step and its figures whenever a line is logged.

    Returns:
        The number of steps made in all.

    Raises:
        TrainingError: The loss is not finite (the last checkpoint is kept), or the folder holds
            another run.
        CheckpointError: `resume` without a checkpoint.
    """
    output = Path(output)
    output.mkdir(parents=True, exist_ok=True)
    if not resume and (output / CHECKPOINT).exists():
        raise TrainingError(
            f"{output} holds another run; go on with it (resume), or give another folder"
        )
    step, spent = _resumed(phase, output) if resume else (0, 0.0)
    started = time.monotonic() - spent
    since: list[Log] = []
    with _finishing_on_signal() as wish:
        while step < schedule.steps and not wish.is_set():
            elapsed = time.monotonic() - started
            progress = step / schedule.steps
            if schedule.minutes:
                progress = max(progress, elapsed / (60 * schedule.minutes))
            if progress >= 1:
                break
            torch.manual_seed(schedule.seed * 1_000_003 + step)
            figures = phase.step(progress)
            _must_be_finite(figures, step, output)
            since.append(figures)
            step += 1
            _pause(phase, output, schedule, (step, elapsed, since), on_log)
    _save(phase, output, step, time.monotonic() - started)
    return step


def learning_rate_share(progress: float, warmup: float = 0.0) -> float:
    """Linear warm-up, then a half cosine down to zero."""
    if progress < warmup:
        return (progress + 1e-9) / warmup
    return 0.5 * (1 + math.cos(math.pi * (progress - warmup) / (1 - warmup)))


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


@contextlib.contextmanager
def _finishing_on_signal() -> Iterator[threading.Event]:
    """Turn Ctrl-C and SIGTERM into a wish to stop after the current step; twice means at once.

    A step that is broken off in the middle would leave weights that no resumed run can repeat.
    Only the main thread may handle signals; elsewhere the event is simply never set.
    """
    wish = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield wish
        return
    signals = (signal.SIGINT, signal.SIGTERM)
    before = {number: signal.getsignal(number) for number in signals}

    def remember(number: int, frame: object) -> None:
        if wish.is_set():
            raise KeyboardInterrupt
        wish.set()

    for number in signals:
        signal.signal(number, remember)
    try:
        yield wish
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _pause(
    phase: Phase,
    output: Path,
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
    if schedule.evaluate_every and step % schedule.evaluate_every == 0:
        figures |= phase.evaluate()
    if figures:
        figures["minutes"] = elapsed / 60
        with (output / METRICS).open("a") as lines:
            lines.write(json.dumps({"step": step, **figures}) + "\n")
        if on_log:
            on_log(step, figures)
    if step % schedule.checkpoint_every == 0:
        _save(phase, output, step, elapsed)


def _save(phase: Phase, output: Path, step: int, spent: float) -> None:
    header: dict[str, Any] = {"kind": "training", "step": step, "spent": spent}
    save_checkpoint(output / CHECKPOINT, phase.tensors(), header)


def _resumed(phase: Phase, output: Path) -> tuple[int, float]:
    header, tensors = load_checkpoint(output / CHECKPOINT)
    if header.get("kind") != "training":
        raise CheckpointError(f"{output / CHECKPOINT} is a model, not the state of a training run")
    phase.restore(tensors)
    return int(header["step"]), float(header["spent"])


def _must_be_finite(figures: Log, step: int, output: Path) -> None:
    bad = [name for name, value in figures.items() if not math.isfinite(value)]
    if bad:
        raise TrainingError(
            f"step {step}: {', '.join(bad)} is not finite. The last checkpoint in {output} is from "
            "before; resume it with a lower learning rate or another seed."
        )
