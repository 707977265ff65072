"""`pe info`, `encode`, `play`, `render`: a model and pictures."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from pe_runtime.cli.terminal import device, parse_frames, progress, show
from pe_runtime.contract.errors import ShotError

Model = Annotated[str, typer.Option(help="Name of a built-in model, or a model file.")]
DEFAULT_MODEL = "duel"


def info(model: Annotated[str, typer.Argument(help="Name or file.")] = DEFAULT_MODEL) -> None:
    """Say what a model knows: its objects, actions and rate."""
    from pe_runtime.environment import PlayableEnvironment, find_model

    file = find_model(model)
    environment = PlayableEnvironment.load(file, "cpu")
    config = environment.config
    header = {k: v for k, v in environment.header.items() if k not in ("config", "action_names")}
    show(
        {
            "name": config.name,
            "file": str(file),
            "bytes": file.stat().st_size,
            "size": f"{config.width}x{config.height}",
            "steps_per_second": config.steps_per_second,
            "objects": {each.name: each.class_name for each in config.objects},
            "actions": {name: list(each) for name, each in environment.action_names.items()},
            "header": header,
        }
    )


def encode(
    image: Annotated[Path, typer.Argument(help="The picture: PNG, JPEG or EXR.")],
    camera: Annotated[
        Path, typer.Option(help="JSON: width, height, intrinsics, world_from_camera")
    ],
    boxes: Annotated[Path, typer.Option(help="JSON: object -> left, top, right, bottom in pixels")],
    output: Annotated[Path, typer.Option("--out", "-o", help="State file to write.")],
    model: Model = DEFAULT_MODEL,
) -> None:
    """Find every object's position, style and pose in a picture."""
    from pe_runtime.contract.shot import Start
    from pe_runtime.environment import PlayableEnvironment
    from pe_runtime.shots import start_state
    from pe_runtime.shots.clips import STATE_CAMERA
    from pe_runtime.state import state_as_dict

    listed = {"image": str(image), "camera": _read_json(camera), "boxes": _read_json(boxes)}
    start = Start.from_dict(listed, f"{camera}, {boxes}")
    state = start_state(PlayableEnvironment.load(model, device()), start)
    content = state_as_dict(state) | {STATE_CAMERA: start.camera.as_dict()}
    _write_text(output, json.dumps(content, indent=1))
    places = {name: [round(x, 3) for x in state[name].position.tolist()] for name in start.boxes}
    show({"state": str(output), "positions": places})


def play(
    start: Annotated[Path, typer.Option(help="A clip's folder, or a state file of `pe encode`.")],
    actions: Annotated[str, typer.Option(help="player_1=left*5,raise_arm*2;player_2=idle*7")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the frames.")],
    mp4: Annotated[bool, typer.Option("--mp4", help="Also write play.mp4.")] = False,
    fps: Annotated[float | None, typer.Option(help="Default: the model's steps a second.")] = None,
    model: Model = DEFAULT_MODEL,
) -> None:
    """Roll actions out from a picture and draw the frames, without Blender."""
    from pe_runtime.environment import PlayableEnvironment
    from pe_runtime.shots import prepare_shot, render_shot
    from pe_runtime.shots.action_text import parse_actions
    from pe_runtime.shots.clips import shot_of_actions, start_from

    environment = PlayableEnvironment.load(model, device())
    rate = environment.steps_per_second
    runs = parse_actions(actions, environment.action_names)
    shot = shot_of_actions(model, start_from(start), runs, fps or rate, rate)
    with progress("frames") as report:
        done = render_shot(environment, shot, out, on_progress=report)
    states = prepare_shot(environment, shot).rollout.states
    paths = {
        name: [each[name].position.tolist() for each in states]
        for name in environment.playable_names
    }
    (out / "shot.json").write_text(_with_absolute_start(shot).to_json())
    video = _join(out, list(shot.frames), shot.fps, "play.mp4") if mp4 else None
    show(_frames_result(out, done) | {"video": video, "paths": paths}, _summary(out, done, video))


def render(
    shot: Annotated[Path, typer.Argument(help="Shot file; relative paths count from its folder.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the frames.")],
    frames: Annotated[str | None, typer.Option(help="Only these, such as 1-24,30.")] = None,
    resume: Annotated[bool, typer.Option(help="Keep frames that are still right.")] = True,
    mp4: Annotated[bool, typer.Option("--mp4", help="Also write render.mp4.")] = False,
) -> None:
    """Draw the frames of a shot."""
    from pe_runtime.environment import PlayableEnvironment
    from pe_runtime.shots import load_shot, render_shot

    job, wanted = load_shot(shot), None if frames is None else parse_frames(frames)
    environment = PlayableEnvironment.load(job.model, device())
    with progress("frames") as report:
        done = render_shot(environment, job, out, wanted, resume, report)
    video = _join(out, wanted or list(job.frames), job.fps, "render.mp4") if mp4 else None
    show(_frames_result(out, done) | {"video": video}, _summary(out, done, video))


def _frames_result(out: Path, done: Any) -> dict[str, Any]:  # noqa: ANN401 a RenderReport
    return {
        "folder": str(out),
        "written": list(done.written),
        "kept": list(done.kept),
        "seconds": round(done.seconds, 3),
    }


def _summary(out: Path, done: Any, video: str | None) -> str:  # noqa: ANN401 a RenderReport
    drawn, kept = len(done.written), len(done.kept)
    rate = f", {drawn / done.seconds:.2f} frames a second" if drawn else ""
    also = f"\nvideo: {video}" if video else ""
    return f"{out}: {drawn} frames drawn, {kept} kept, {done.seconds:.1f} s{rate}{also}"


def _join(out: Path, frames: list[int], fps: float, name: str) -> str:
    from pe_runtime.shots import frame_path
    from pe_runtime.shots.video import write_video

    write_video([frame_path(out, frame) for frame in sorted(set(frames))], fps, out / name)
    return str(out / name)


def _with_absolute_start(shot: Any) -> Any:  # noqa: ANN401 a Shot
    """The shot as another folder can hold it."""
    import dataclasses

    def absolute(path: str | None) -> str | None:
        return None if path is None else str(Path(path).resolve())

    start = dataclasses.replace(
        shot.start, image=absolute(shot.start.image), state=absolute(shot.start.state)
    )
    return dataclasses.replace(shot, start=start)


def _read_json(path: Path) -> Any:  # noqa: ANN401 any JSON value
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise ShotError(f"cannot read {path} as JSON ({error})") from error


def _write_text(path: Path, text: str) -> None:
    """Write a small file whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.part")
    unfinished.write_text(text)
    unfinished.replace(path)
