"""Runs the demo: measures the encoder here, lets Blender film, and reports what came out."""

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pe_runtime.contract.errors import PlayableEnvironmentError
from pe_runtime.contract.shot import Start
from pe_runtime.demo.contact_sheet import Cell, write_contact_sheet
from pe_runtime.demo.script import demo_runs
from pe_runtime.environment import MODELS, PlayableEnvironment
from pe_runtime.evaluation.visual import psnr
from pe_runtime.images import read_image
from pe_runtime.shots.action_text import Runs, keys_of, parse_actions
from pe_runtime.shots.clips import start_from_clip

BLENDER_PROGRAM = ("-m", "blender_addon.examples.demo_scene")
FRAMES, FPS = 24, 12
CAMERA_MOVE = {"azimuth_degrees": 12.0, "dolly_metres": -0.5}
SHEET_FRAMES = 8
POLL_SECONDS = 0.2
LOG_LINES = 15
MADE_BY_DEMO = (
    "frames/*.png",
    "blender_report.json",
    "report.json",
    "contact_sheet.png",
    "*.mp4",
    "*.blend*",
)


class DemoError(PlayableEnvironmentError):
    """Blender could not film the demo; the message has its last words."""


@dataclass(frozen=True)
class DemoOptions:
    """What may be changed about the demo."""

    model: str = "duel"
    actions: str | None = None
    """As text; None for the built-in script."""
    size: tuple[int, int] | None = None
    """Width and height of the film; None for the picture's."""
    quality: str = "exact"
    clip: Path | None = None
    """Clip whose first picture is used; None for the one that comes with the model `duel`."""
    device: str = "auto"


@dataclass
class Clock:
    """Seconds per stage."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time the block."""
        began = time.perf_counter()
        yield
        self.seconds[name] = round(time.perf_counter() - began, 3)


def run_demo(
    out: str | Path,
    options: DemoOptions = DemoOptions(),
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[str, Any]:
    """Make the demo in a folder and return its report, which is also written as report.json.

    Args:
        out: Gets spec.json, frames/, demo.blend, demo.mp4, contact_sheet.png, report.json.
        options: What is filmed, and how.
        on_progress: Called with frames drawn and their number while Blender renders.

    Raises:
        DemoError: Blender is missing or failed.
        PlayableEnvironmentError: The clip, the model or the actions are at fault.
    """
    out, clock = Path(out).resolve(), Clock()
    _clear(out)
    start = start_from_clip(options.clip or MODELS / "duel_clip")
    with clock.stage("load model"):
        environment = PlayableEnvironment.load(options.model, options.device)
    with clock.stage("compare first picture"):
        likeness = _psnr_of_start(environment, start)
    keys = _action_keys(environment, start, options.actions)
    spec = spec_of(out, options, start, keys)
    (out / "spec.json").write_text(json.dumps(spec, indent=1))
    with clock.stage("blender"):
        filmed = film_in_blender(out, BLENDER_PROGRAM, on_progress)
    frames = [Path(path) for path in filmed["frames"]]
    with clock.stage("contact sheet"):
        sheet = out / "contact_sheet.png"
        write_contact_sheet(_cells(start, frames, keys), sheet)
    blender = {f"blender {name}": value for name, value in filmed["stages"].items()}
    report = {
        "model": options.model,
        "picture": start.image,
        "psnr_of_first_frame": round(likeness, 3),
        "seconds": clock.seconds | blender,
        "frames": len(frames),
        "frames_per_second": round(len(frames) / max(filmed["stages"]["render"], 1e-9), 3),
        "actions": keys,
        "camera_move": CAMERA_MOVE,
        "paths": filmed["paths"],
        "video": filmed["video"],
        "blend": str(out / "demo.blend"),
        "contact_sheet": str(sheet),
    }
    (out / "report.json").write_text(json.dumps(report, indent=1))
    return report


def _clear(out: Path) -> None:
    """Remove what an earlier demo left, so that nothing old is taken for new."""
    (out / "frames").mkdir(parents=True, exist_ok=True)
    for pattern in MADE_BY_DEMO:
        for path in out.glob(pattern):
            path.unlink()


def _psnr_of_start(environment: PlayableEnvironment, start: Start) -> float:
    picture = read_image(start.image)
    state = environment.encode(picture, start.camera, start.boxes)
    return float(psnr(environment.render(state, start.camera).rgb, picture))


def _action_keys(
    environment: PlayableEnvironment, start: Start, text: str | None
) -> dict[str, list[list[Any]]]:
    """Keys `[frame, action name]` per player in the picture."""
    names = environment.action_names
    runs: Runs = parse_actions(text, names) if text else demo_runs(list(start.boxes), names)
    frames_per_step = FPS / environment.steps_per_second
    return {
        name: [[frame, names[name][action]] for frame, action in keys_of(run, 1, frames_per_step)]
        for name, run in runs.items()
    }


def spec_of(
    out: Path, options: DemoOptions, start: Start, keys: Mapping[str, list[list[Any]]]
) -> dict[str, Any]:
    """What the spec file says of a film from a start, with these keys."""
    width, height = options.size or (start.camera.width, start.camera.height)
    return {
        "image": start.image,
        "camera": start.camera.as_dict(),
        "boxes": {name: list(box) for name, box in start.boxes.items()},
        "model": options.model,
        "out": str(out),
        "width": width,
        "height": height,
        "frame_start": 1,
        "frame_end": FRAMES,
        "fps": FPS,
        "actions": dict(keys),
        "camera_move": CAMERA_MOVE,
        "quality": options.quality,
        "worker": [sys.executable, "-m", "pe_runtime.worker", "--device", options.device],
    }


def film_in_blender(
    out: Path, program: Sequence[str], on_progress: Callable[[int, int], None]
) -> dict[str, Any]:
    """Let Blender film a folder's spec.json in a process of its own and return its report.

    Args:
        out: The folder; gets blender.log beside what the program makes.
        program: Arguments of Python that run it.
        on_progress: Called with frames drawn and their number.

    Raises:
        DemoError: Blender is missing or failed.
    """
    command = [sys.executable, *program, "--spec", str(out / "spec.json")]
    log = out / "blender.log"
    with log.open("wb") as words:
        process = subprocess.Popen(command, stdout=words, stderr=subprocess.STDOUT)
        try:
            while process.poll() is None:
                on_progress(min(len(list(out.glob("*/frame_*.png"))), FRAMES), FRAMES)
                time.sleep(POLL_SECONDS)
        finally:
            # After Ctrl-C: the worker ends by itself when Blender's end of its pipe closes.
            process.kill()
            process.wait()
    report = out / "blender_report.json"
    if process.returncode != 0 or not report.is_file():
        raise DemoError(_failure(log, process.returncode))
    on_progress(FRAMES, FRAMES)
    (out / "demo.blend1").unlink(missing_ok=True)  # Blender's copy of the empty file before.
    return json.loads(report.read_text())


def _failure(log: Path, code: int) -> str:
    lines = log.read_text(errors="replace").strip().splitlines()
    if any("No module named 'bpy'" in line for line in lines):
        extra = "playable-environments[blender]"
        return f"the demo needs Blender as a Python module: pip install '{extra}'"
    said = " | ".join(lines[-LOG_LINES:]) or "(nothing)"
    return f"Blender ended with exit code {code}; its last words ({log}): {said}"


def _cells(start: Start, frames: list[Path], keys: Mapping[str, list[list[Any]]]) -> list[Cell]:
    """The start picture, then frames evenly spaced over the film."""
    cells = [Cell(Path(start.image), "the picture")]
    last = len(frames) - 1
    for step in range(SHEET_FRAMES):
        index = round(step * last / (SHEET_FRAMES - 1))
        frame = index + 1
        told = ", ".join(f"{name}: {_held(track, frame)}" for name, track in keys.items())
        cells.append(Cell(frames[index], f"frame {frame}", told))
    return cells


def _held(track: list[list[Any]], frame: int) -> str:
    return [action for key, action in track if key <= frame][-1]
