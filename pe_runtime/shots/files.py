"""Shots on disk: the document with its relative paths, and the frames with their digests."""

import dataclasses
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.shot import Shot
from pe_runtime.environment import Frame
from pe_runtime.images import linear_from_srgb, read_metadata, write_exr, write_png
from pe_runtime.shots.frames import (
    OnProgress,
    ShouldStop,
    frame_digest,
    model_digest,
    render_frames,
    select_frames,
)
from pe_runtime.shots.rollout import PreparedShot, World, prepare_shot

DIGEST_KEY = "playable_environment_digest"


@dataclass(frozen=True)
class RenderReport:
    """What rendering a shot to disk did."""

    written: tuple[int, ...]
    """Frames drawn now."""
    kept: tuple[int, ...]
    """Frames found on disk with unchanged inputs."""
    seconds: float


@dataclass(frozen=True)
class FramePlan:
    """Which of the wanted frames a folder lacks, and all that drawing them takes."""

    prepared: PreparedShot
    folder: Path
    digests: Mapping[int, str]
    """Per wanted frame, over everything that decides its pixels."""
    kept: tuple[int, ...]
    """Frames found on disk with unchanged inputs."""
    missing: tuple[int, ...]
    """Frames to draw."""
    began: float
    """When planning began, on the clock of `time.perf_counter`."""


def load_shot(path: str | Path) -> Shot:
    """Read a shot file; its relative paths count from the file's folder.

    Raises:
        ShotError: The file is missing or no shot.
    """
    try:
        text = Path(path).read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise ShotError(f"cannot read the shot {path} ({error})") from error
    shot, folder = Shot.from_json(text, str(path)), Path(path).parent

    def anchored(name: str | None) -> str | None:
        return None if name is None else str(folder / name)

    start = dataclasses.replace(
        shot.start, image=anchored(shot.start.image), state=anchored(shot.start.state)
    )
    tracks = (
        dataclasses.replace(
            track,
            styles=tuple(
                dataclasses.replace(mix, image=anchored(mix.image)) for mix in track.styles
            ),
        )
        for track in shot.objects
    )
    return dataclasses.replace(shot, start=start, objects=tuple(tracks))


def render_shot(
    world: World,
    shot: Shot,
    output: str | Path,
    frames: Iterable[int] | None = None,
    resume: bool = True,
    on_progress: OnProgress | None = None,
    should_stop: ShouldStop | None = None,
) -> RenderReport:
    """Draw frames of a shot into a folder: `0001.png`, and `0001.exr` where passes are asked for.

    Args:
        world: The loaded environment.
        shot: The job.
        output: Folder; made if missing.
        frames: Frames to draw; None for all.
        resume: Keep files whose inputs have not changed since they were written.
        on_progress: Called after every frame with the number done and the total.
        should_stop: Asked before every frame; files written so far stay.

    Raises:
        RenderCancelledError: `should_stop` said so.
        ShotError: The shot cannot be run in this environment.
    """
    plan = plan_frames(world, shot, output, frames, resume)
    return draw_missing(world, plan, on_progress, should_stop)


def plan_frames(
    world: World,
    shot: Shot,
    output: str | Path,
    frames: Iterable[int] | None = None,
    resume: bool = True,
) -> FramePlan:
    """Roll a shot out and look which of its frames a folder already has; as `render_shot`."""
    began, folder = time.perf_counter(), Path(output)
    folder.mkdir(parents=True, exist_ok=True)
    prepared = prepare_shot(world, shot)
    wanted = select_frames(shot, frames)
    model = model_digest(world)
    digests = {frame: frame_digest(model, prepared, frame) for frame in wanted}
    kept = [n for n in wanted if resume and _is_current(folder, n, shot, digests[n])]
    missing = [frame for frame in wanted if frame not in kept]
    return FramePlan(prepared, folder, digests, tuple(kept), tuple(missing), began)


def draw_missing(
    world: World,
    plan: FramePlan,
    on_progress: OnProgress | None = None,
    should_stop: ShouldStop | None = None,
) -> RenderReport:
    """Draw and write the frames of a plan that its folder lacks; as `render_shot`."""
    drawn = render_frames(world, plan.prepared, plan.missing, should_stop=should_stop)
    for done, (number, frame) in enumerate(drawn, start=len(plan.kept) + 1):
        write_frame(plan.folder, number, frame, plan.digests[number])
        if on_progress is not None:
            on_progress(done, len(plan.digests))
    return RenderReport(plan.missing, plan.kept, time.perf_counter() - plan.began)


def frame_path(folder: Path, frame: int) -> Path:
    """The picture of a frame."""
    return folder / f"{frame:04d}.png"


def write_frame(folder: Path, number: int, frame: Frame, digest: str) -> None:
    """Write a frame's picture, and beside it its passes if it has any."""
    path, metadata = frame_path(folder, number), {DIGEST_KEY: digest}
    if has_passes(frame):
        write_exr(path.with_suffix(".exr"), exr_channels(frame), metadata)
    write_png(path, frame.rgb, metadata)


def has_passes(frame: Frame) -> bool:
    """Whether a frame holds more than its picture."""
    return (
        frame.depth is not None or frame.background is not None or bool(frame.masks | frame.layers)
    )


def exr_channels(frame: Frame) -> dict[str, np.ndarray]:
    """A frame's channels by the names that compositing programs know, linear.

    R, G, B; Z in metres; `mask.NAME`; `background.R` and so on; `layer.NAME.R` to `.A`, whose
    colours carry their alpha (premultiplied), as is the rule in EXR files.
    """
    channels = _coloured("", linear_from_srgb(frame.rgb))
    if frame.depth is not None:
        channels["Z"] = frame.depth
    channels |= {f"mask.{name}": mask for name, mask in frame.masks.items()}
    if frame.background is not None:
        channels |= _coloured("background.", linear_from_srgb(frame.background))
    for name, layer in frame.layers.items():
        alpha = layer[..., 3]
        channels |= _coloured(f"layer.{name}.", linear_from_srgb(layer[..., :3]) * alpha[..., None])
        channels[f"layer.{name}.A"] = alpha
    return channels


def _coloured(prefix: str, linear: np.ndarray) -> dict[str, np.ndarray]:
    return {f"{prefix}{name}": linear[..., index] for index, name in enumerate("RGB")}


def _is_current(folder: Path, frame: int, shot: Shot, digest: str) -> bool:
    paths = [frame_path(folder, frame)]
    if shot.passes:
        paths.append(paths[0].with_suffix(".exr"))
    return all(read_metadata(path).get(DIGEST_KEY) == digest for path in paths)
