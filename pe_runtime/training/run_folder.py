"""The folder of a training run: its checkpoint, its figures, and what they look like."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jaxtyping import Float
from torch import Tensor

from pe_runtime.checkpoint import load_checkpoint, save_checkpoint
from pe_runtime.contract.errors import CheckpointError
from pe_runtime.images import write_png
from pe_runtime.training.curves import write_curves

CHECKPOINT = "checkpoint.safetensors"
METRICS = "metrics.jsonl"
CURVES = "curves.png"
SAMPLES = "samples"


class RunFolder:
    """Where a run keeps what it has.

    Args:
        path: The folder; made where it is missing.
        writes: False for the processes of a run that leave all writing to another.
    """

    def __init__(self, path: str | Path, writes: bool = True) -> None:
        self.path, self.writes = Path(path), writes
        self.path.mkdir(parents=True, exist_ok=True)

    @property
    def in_use(self) -> bool:
        """Whether a run has left its checkpoint here."""
        return (self.path / CHECKPOINT).exists()

    def save(self, tensors: Mapping[str, Tensor], step: int, spent: float) -> None:
        """Store the state of the run.

        Args:
            tensors: Weights, optimiser, running statistics.
            step: Steps made.
            spent: Seconds that they took.
        """
        if self.writes:
            header: dict[str, Any] = {"kind": "training", "step": step, "spent": spent}
            save_checkpoint(self.path / CHECKPOINT, tensors, header)

    def load(self) -> tuple[dict[str, Tensor], int, float]:
        """What `save` stored last.

        Raises:
            CheckpointError: There is none, or it is something else.
        """
        header, tensors = load_checkpoint(self.path / CHECKPOINT)
        if header.get("kind") != "training":
            raise CheckpointError(
                f"{self.path / CHECKPOINT} is a model, not the state of a training run"
            )
        return tensors, int(header["step"]), float(header["spent"])

    def note(self, step: int, figures: Mapping[str, float]) -> None:
        """Add a line to the figures."""
        if self.writes:
            with (self.path / METRICS).open("a") as lines:
                lines.write(json.dumps({"step": step, **figures}) + "\n")

    def forget_after(self, step: int) -> None:
        """Take out figures of steps that will be made again, as after a crash."""
        metrics = self.path / METRICS
        if not self.writes or not metrics.exists():
            return
        # A line that a crash has cut short goes as well.
        kept = [line for line in self.figures() if line["step"] <= step]
        part = metrics.with_name(f".{METRICS}.part")
        part.write_text("".join(json.dumps(line) + "\n" for line in kept))
        part.replace(metrics)

    def figures(self) -> list[dict[str, float | int]]:
        """All lines of figures that can be read."""
        metrics, found = self.path / METRICS, []
        for line in metrics.read_text().splitlines() if metrics.exists() else []:
            try:
                found.append(json.loads(line))
            except ValueError:
                continue
        return found

    def draw_curves(self) -> None:
        """Show the figures as curves, once there are two lines of them."""
        if self.writes:
            lines = self.figures()
            if len(lines) > 1:
                write_curves(lines, self.path / CURVES)

    def show(self, step: int, sheet: Float[Tensor, "rows columns 3"] | None) -> None:
        """Store a sheet of sample pictures, if there is one."""
        if self.writes and sheet is not None:
            folder = self.path / SAMPLES
            folder.mkdir(exist_ok=True)
            write_png(folder / f"{step:07d}.png", sheet.cpu().numpy())

    def keep_evidence(
        self, tensors: Mapping[str, Tensor], step: int, facts: Mapping[str, Any]
    ) -> Path:
        """Store the batch that broke a run.

        Args:
            tensors: The batch.
            step: The step that broke.
            facts: What else describes it, JSON-able.
        """
        path = self.path / f"broken-{step:07d}.safetensors"
        if self.writes:
            save_checkpoint(path, tensors, {"kind": "broken step", "step": step, **facts})
        return path
