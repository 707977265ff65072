"""A training as it goes: a live line on a terminal, plain lines elsewhere."""

import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from pe_runtime.cli.terminal import note

if TYPE_CHECKING:
    from pe_runtime.training.loop import Moment

SMOOTHING = 0.1
"""Weight of the last step in the running means that are shown."""


class Watch:
    """What a live display shows of a training.

    Args:
        bar: Where it is drawn.
        now: The time in seconds, by any clock.
    """

    def __init__(self, bar: Progress, now: Callable[[], float]) -> None:
        self.bar, self.now = bar, now
        self.task: TaskID | None = None
        self.first: tuple[float, float, int] | None = None
        self.means: dict[str, float] = {}
        self.measured: dict[str, float] = {}

    def stepped(self, moment: "Moment") -> None:
        """Show a step that was made."""
        if self.task is None or moment.step == 1:
            self.task = self.bar.add_task("training", total=1.0, said="", left="")
            self.first, self.means = None, {}
        if self.first is None:
            # The first step builds its kernels; rates count from its end.
            self.first = (self.now(), moment.progress, moment.step)
        for name, value in moment.figures.items():
            before = self.means.get(name, value)
            self.means[name] = before + SMOOTHING * (value - before)
        rate, left = self._pace(moment)
        said = [f"step {moment.step}/{moment.steps}"]
        said += [f"{n} {v:.4g}" for n, v in self.means.items() if n in ("loss", "psnr_patch")]
        said += [f"{n} {v:.2f}" for n, v in self.measured.items() if n.startswith("psnr")]
        said += [f"{rate:.2f} steps/s"] if rate else []
        done = min(moment.progress, 1.0)
        self.bar.update(self.task, completed=done, said=", ".join(said), left=left)

    def logged(self, step: int, figures: Mapping[str, float]) -> None:
        """Remember what was measured on held-out data."""
        self.measured = self.measured | {n: v for n, v in figures.items() if n not in self.means}

    def _pace(self, moment: "Moment") -> tuple[float, str]:
        """Steps per second, and the time left in words; nothing after a single step."""
        began, progress, step = self.first
        seconds = self.now() - began
        if seconds <= 0 or moment.step == step:
            return 0.0, ""
        gone = moment.progress - progress
        left = seconds * max(0.0, 1 - moment.progress) / gone if gone > 0 else 0.0
        hours, rest = divmod(round(left), 3600)
        return (moment.step - step) / seconds, f"{hours}:{rest // 60:02d}:{rest % 60:02d} left"


@contextmanager
def watching(
    live: bool,
) -> Iterator[tuple[Callable[[int, Mapping[str, float]], None], "Callable[[Moment], None] | None"]]:
    """What a training calls when it logs, and after every step.

    Args:
        live: Show a live line on stderr, if both stderr and stdout are terminals; otherwise each
            line of the log is told.
    """
    console = Console(stderr=True)
    if not (live and console.is_terminal and sys.stdout.isatty()):
        yield told, None
        return
    columns = (
        BarColumn(bar_width=20),
        TextColumn("{task.fields[said]}"),
        TimeElapsedColumn(),
        TextColumn("{task.fields[left]}"),
    )
    with Progress(*columns, console=console) as bar:
        watch = Watch(bar, time.monotonic)
        yield watch.logged, watch.stepped


def told(step: int, figures: Mapping[str, float]) -> None:
    """A line of the log, on stderr."""
    note(f"step {step}: " + ", ".join(f"{name} {value:.4g}" for name, value in figures.items()))
