"""`pe play`: from one picture, by script or by hand, to frames and a film."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from pe_runtime.cli.interrupts import EXIT_CODE, stop_on_interrupt
from pe_runtime.cli.option_groups import grouped
from pe_runtime.cli.pictures import (
    DEFAULT_MODEL,
    Model,
    frames_result,
    frames_summary,
    join_frames,
)
from pe_runtime.cli.terminal import device, note, parse_size, progress, show
from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.shot import Start


@dataclass(frozen=True)
class StartOptions:
    """Where a take begins."""

    start: Annotated[
        Path | None,
        typer.Option(
            help="A clip's folder, or a state file of `pe encode`; default: the clip that "
            "comes with the model."
        ),
    ] = None
    image: Annotated[
        Path | None, typer.Option(help="Or a picture: PNG, JPEG or EXR, with the next two.")
    ] = None
    camera: Annotated[
        Path | None, typer.Option(help="JSON: width, height, intrinsics, world_from_camera")
    ] = None
    boxes: Annotated[
        Path | None, typer.Option(help="JSON: object -> left, top, right, bottom in pixels")
    ] = None


@dataclass(frozen=True)
class FrameOptions:
    """What the frames are like."""

    fps: Annotated[float | None, typer.Option(help="Default: the model's steps a second.")] = None
    size: Annotated[
        str | None, typer.Option(help="Pixels, such as 512x288; default: the picture's.")
    ] = None
    quality: Annotated[str, typer.Option(help="exact, balanced or draft.")] = "exact"
    style: Annotated[
        list[str] | None,
        typer.Option(help="Who looks like whom, and how much: player_1=player_2:0.7"),
    ] = None
    mp4: Annotated[bool, typer.Option("--mp4", help="Also write play.mp4.")] = False
    preview: Annotated[bool, typer.Option(help="Show pictures in the terminal.")] = True


@dataclass(frozen=True)
class CameraOptions:
    """How the camera moves over a script."""

    orbit: Annotated[
        float, typer.Option(help="Degrees about the players until the last frame, + to the right.")
    ] = 0.0
    rise: Annotated[float, typer.Option("--raise", help="Metres up.")] = 0.0
    dolly: Annotated[float, typer.Option(help="Metres nearer to the players.")] = 0.0


@grouped
def play(
    begin: StartOptions,
    frames: FrameOptions,
    move: CameraOptions,
    actions: Annotated[
        str | None,
        typer.Option(
            help="A script instead of keys: 2*5,4*8;1*13 or player_1=left*5;player_2=idle"
        ),
    ] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the frames.")] = Path("play"),
    model: Model = DEFAULT_MODEL,
) -> None:
    """Play the people in a picture, with keys or from a script; frames and a film come out.

    Without --actions digits act, and other keys move the camera, change styles, undo and film.
    Where stdin is no terminal, its lines do the same.
    """
    from pe_runtime.environment import PlayableEnvironment
    from pe_runtime.play import (
        CameraMove,
        LivePlay,
        Wishes,
        learnt_actions,
        parse_styles,
        set_stage,
        shot_of_script,
    )
    from pe_runtime.shots.action_text import parse_actions

    environment = PlayableEnvironment.load(model, device())
    learnt = learnt_actions(environment)
    styles = parse_styles(frames.style or (), environment.playable_names)
    size = None if frames.size is None else parse_size(frames.size)
    wishes = Wishes(frames.fps, size, frames.quality, styles)
    names = {player: tuple(each.name for each in learnt[player]) for player in learnt}
    runs = None if actions is None else parse_actions(actions, names)
    stage = set_stage(environment, model, _start(begin, model), learnt, wishes)
    absent = [player for player in learnt if player not in stage.players]
    if absent:
        note(f"not in the picture, so not to be seen: {', '.join(absent)}")
    path = CameraMove(move.orbit, move.rise, move.dolly)
    if runs is not None:
        _play_script(environment, shot_of_script(stage, runs, path), out, frames.mp4)
        return
    if path != CameraMove():
        raise ShotError(
            "--orbit, --raise and --dolly move the camera over a script: give --actions too, or "
            "move the camera by key while playing"
        )
    _play_live(LivePlay(environment, stage, out), frames.mp4, frames.preview)


def _start(begin: StartOptions, model: str) -> tuple[Start, Camera]:
    from pe_runtime.shots.clips import sample_clip, start_from, start_from_picture

    picture = {"--image": begin.image, "--camera": begin.camera, "--boxes": begin.boxes}
    missing = [option for option, given in picture.items() if given is None]
    if len(missing) == len(picture):
        return start_from(begin.start or sample_clip(model))
    if begin.start is not None:
        raise ShotError("start from --start or from --image with --camera and --boxes, not both")
    if missing:
        raise ShotError(
            f"to start from a picture give --image, --camera and --boxes too; {', '.join(missing)} "
            'missing. Camera: JSON with "width", "height", "intrinsics", "world_from_camera"; '
            'boxes: JSON such as {"player_1": [left, top, right, bottom]} in pixels. Without any '
            "of them the model's sample clip is played"
        )
    start = start_from_picture(begin.image, begin.camera, begin.boxes)
    return start, start.camera


def _play_script(environment: Any, shot: Any, out: Path, mp4: bool) -> None:  # noqa: ANN401
    """Draw a shot; after Ctrl-C say which of its frames are there."""
    from pe_runtime.play import finished_frames, write_shot
    from pe_runtime.shots import RenderCancelledError, prepare_shot, render_shot

    states = prepare_shot(environment, shot).rollout.states
    paths = {
        name: [each[name].position.tolist() for each in states]
        for name in environment.playable_names
    }
    result = {"folder": str(out), "shot": str(write_shot(shot, out)), "paths": paths}
    try:
        with progress("frames") as report, stop_on_interrupt() as stopped:
            done = render_shot(environment, shot, out, on_progress=report, should_stop=stopped)
    except RenderCancelledError:
        frames = finished_frames(environment, shot, out)
        said = f"{out}: stopped; frames {_ranges(frames)} of {len(shot.frames)} are there"
        again = "the same command draws the others"
        show(result | {"frames": list(frames), "stopped": True}, f"{said}; {again}")
        raise typer.Exit(EXIT_CODE) from None
    video = join_frames(out, list(shot.frames), shot.fps, "play.mp4") if mp4 else None
    result |= {"frames": list(shot.frames), "stopped": False, "video": video}
    show(result | frames_result(out, done), frames_summary(out, done, video))


def _play_live(live: Any, mp4: bool, preview: bool) -> None:  # noqa: ANN401 a LivePlay
    from pe_runtime.cli.live import play_live

    takes, stopped = play_live(live, mp4, preview)
    lines = [
        f"{take.folder}: frames {_ranges(take.frames)}; again with: pe render {take.shot} -o FOLDER"
        + (f"\nvideo: {take.video}" if take.video else "")
        for take in takes
    ]
    lines += ["stopped: the frames of the last take are as they were drawn"] if stopped else []
    show({"takes": [take.as_dict() for take in takes], "stopped": stopped}, "\n".join(lines))
    if stopped:
        raise typer.Exit(EXIT_CODE)


def _ranges(numbers: Sequence[int]) -> str:
    """`1-4, 7` for (1, 2, 3, 4, 7)."""
    if not numbers:
        return "none"
    starts = [n for n in numbers if n - 1 not in numbers]
    ends = [n for n in numbers if n + 1 not in numbers]
    pairs = zip(starts, ends, strict=True)
    return ", ".join(str(a) if a == b else f"{a}-{b}" for a, b in pairs)
