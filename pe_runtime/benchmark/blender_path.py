"""What a frame costs in Blender beyond the worker's drawing of it, part by part.

Blender runs in a process of its own (`blender_addon.examples.path_costs`) with a real worker. A
frame's overhead is its wall time in Blender minus the seconds for which the worker says it drew.
"""

import dataclasses
import json
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pe_runtime.contract.errors import PlayableEnvironmentError
from pe_runtime.contract.shot import Start
from pe_runtime.images import write_png
from pe_runtime.shots.clips import sample_clip, start_from_clip
from pe_runtime.worker.fake_world import FakeWorld

BLENDER_PROGRAM = ("-m", "blender_addon.examples.path_costs")
FAKE = "fake"
WIDTH, HEIGHT = 512, 288
FRAMES = 24
LIMIT_MS = 15.0
"""What the median overhead of a frame of that size must stay below."""
PARTS = ("evaluate", "request", "pipe", "conversion", "result", "save")
LOG_LINES = 6
BOX_SHARES = {"player_1": (0.2, 0.3, 0.3, 0.8), "player_2": (0.6, 0.3, 0.7, 0.8)}
"""Left, top, right, bottom of the players in the fake world's picture, in shares of its size."""


class BlenderPathError(PlayableEnvironmentError):
    """Blender is missing or could not draw; the message has its last words."""


@dataclass(frozen=True)
class PathJob:
    """What is drawn, and how often.

    Attributes:
        model: Built-in name or file; "fake" for the worker that draws a gradient without torch.
        start: Where it starts; None for the model's sample clip.
        quality: exact, balanced or draft.
        size: Columns and rows.
        frames: Counted frames of each way.
        device: Where the model computes.
    """

    model: str = FAKE
    start: Start | None = None
    quality: str = "exact"
    size: tuple[int, int] = (WIDTH, HEIGHT)
    frames: int = FRAMES
    device: str = "cpu"


@dataclass(frozen=True)
class WayCost:
    """One way through Blender; all times in milliseconds a frame.

    Attributes:
        way: "still" as F12 draws it, or "range", drawn to PNG files.
        passes: Passes beside the picture.
        frames: How many were timed.
        overhead: Median of wall time minus the worker's drawing.
        quartiles: The overheads that a quarter and three quarters of the frames stay below.
        drawing: Median of the worker's own time.
        parts: Medians. `evaluate` the scene, `request` read and sent, `pipe` the worker's answer
            beyond its drawing, `conversion` of bytes, render `result` set, `save` colours and file.
            In a range the worker draws ahead: a negative `pipe` is what Blender did meanwhile.
    """

    way: str
    passes: tuple[str, ...]
    frames: int
    overhead: float
    quartiles: tuple[float, float]
    drawing: float
    parts: Mapping[str, float]


@dataclass(frozen=True)
class BlenderPath:
    """All ways of one job, and the Blender that they lead through."""

    job: PathJob
    blender: str
    costs: tuple[WayCost, ...]

    @property
    def overhead(self) -> float:
        """Median overhead of the costliest way, milliseconds a frame."""
        return max(cost.overhead for cost in self.costs)


def measure(job: PathJob | None = None) -> BlenderPath:
    """Draw a job in Blender in every way, with the picture alone and with all passes.

    Raises:
        BlenderPathError: Blender is missing or failed.
        PlayableEnvironmentError: The model has no sample clip to start from.
    """
    job = job or PathJob()
    with tempfile.TemporaryDirectory(prefix="pe_blender_path_") as name:
        folder = Path(name)
        spec = _spec(job, folder)
        (folder / "spec.json").write_text(json.dumps(spec))
        command = [sys.executable, *BLENDER_PROGRAM, "--spec", str(folder / "spec.json")]
        done = subprocess.run(command, capture_output=True, text=True, errors="replace")
        if done.returncode != 0:
            raise BlenderPathError(_reason(done.stderr or done.stdout, done.returncode))
        report = json.loads(Path(spec["out"]).read_text())
    return BlenderPath(job, report["blender"], tuple(_cost(way) for way in report["ways"]))


def blender_path_section(job: PathJob | None = None) -> dict[str, Any]:
    """The measurement as plain values for a report; where there is no Blender, the reason.

    Returns:
        `limit_ms`, `width` and `height`, and either `skipped` or the values of `BlenderPath`.
    """
    job = job or PathJob()
    size = {"limit_ms": LIMIT_MS, "width": job.size[0], "height": job.size[1]}
    try:
        found = measure(job)
    except BlenderPathError as error:
        return size | {"skipped": str(error)}
    costs = [dataclasses.asdict(cost) for cost in found.costs]
    return size | {
        "model": job.model,
        "quality": job.quality,
        "blender": found.blender,
        "overhead_ms": found.overhead,
        "costs": costs,
    }


def _spec(job: PathJob, folder: Path) -> dict[str, Any]:
    """What `blender_addon.examples.path_costs.CostSpec` asks for."""
    start = job.start or _usual_start(job, folder)
    fake = job.model == FAKE
    worker = ["--fake"] if fake else ["--device", job.device]
    return {
        "image": str(Path(start.image).resolve()),
        "camera": start.camera.scaled(*job.size).as_dict(),
        "boxes": {name: list(box) for name, box in start.boxes.items()},
        "model": job.model,
        "quality": job.quality,
        "frames": job.frames,
        "worker": [sys.executable, "-u", "-m", "pe_runtime.worker", *worker],
        "folder": str(folder / "frames"),
        "out": str(folder / "report.json"),
    }


def _usual_start(job: PathJob, folder: Path) -> Start:
    if job.model != FAKE:
        return start_from_clip(sample_clip(job.model))
    width, height = job.size
    rows, columns = np.mgrid[:height, :width]
    picture = np.stack([columns, rows, columns + rows], axis=-1) % 256
    write_png(folder / "picture.png", picture.astype(np.uint8))
    camera = FakeWorld().load(FAKE).usual_camera.scaled(width, height)
    boxes = {
        name: (left * width, top * height, right * width, bottom * height)
        for name, (left, top, right, bottom) in BOX_SHARES.items()
    }
    return Start(str(folder / "picture.png"), camera, boxes)


def _cost(way: Mapping[str, Any]) -> WayCost:
    samples: Sequence[Mapping[str, float]] = way["samples"]
    overheads = [1e3 * (each["wall"] - each["drawing"]) for each in samples]
    low, high = np.percentile(overheads, [25, 75])
    return WayCost(
        way=way["way"],
        passes=tuple(way["passes"]),
        frames=len(samples),
        overhead=statistics.median(overheads),
        quartiles=(float(low), float(high)),
        drawing=_median_ms(samples, "drawing"),
        parts={name: _median_ms(samples, name) for name in PARTS},
    )


def _median_ms(samples: Sequence[Mapping[str, float]], name: str) -> float:
    return 1e3 * statistics.median(each[name] for each in samples)


def _reason(log: str, code: int) -> str:
    if "No module named 'bpy'" in log:
        extra = "playable-environments[blender]"
        return f"the path through Blender needs Blender as a Python module: pip install '{extra}'"
    said = " | ".join(log.strip().splitlines()[-LOG_LINES:]) or "(nothing)"
    return f"Blender ended with exit code {code}; its last words: {said}"
