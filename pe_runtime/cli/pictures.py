"""`pe info`, `encode`, `render`: a model and pictures."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from pe_runtime.cli.clusters import Cluster, drawing_on
from pe_runtime.cli.interrupts import EXIT_CODE, stop_on_interrupt
from pe_runtime.cli.terminal import device, note, parse_frames, progress, show

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
    from pe_runtime.environment import PlayableEnvironment
    from pe_runtime.shots import start_state
    from pe_runtime.shots.clips import STATE_CAMERA, start_from_picture
    from pe_runtime.state import state_as_dict

    start = start_from_picture(image, camera, boxes)
    state = start_state(PlayableEnvironment.load(model, device()), start)
    content = state_as_dict(state) | {STATE_CAMERA: start.camera.as_dict()}
    _write_text(output, json.dumps(content, indent=1))
    places = {name: [round(x, 3) for x in state[name].position.tolist()] for name in start.boxes}
    show({"state": str(output), "positions": places})


def render(
    shot: Annotated[Path, typer.Argument(help="Shot file; relative paths count from its folder.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the frames.")],
    frames: Annotated[str | None, typer.Option(help="Only these, such as 1-24,30.")] = None,
    resume: Annotated[bool, typer.Option(help="Keep frames that are still right.")] = True,
    mp4: Annotated[bool, typer.Option("--mp4", help="Also write render.mp4.")] = False,
    cluster: Cluster = None,
) -> None:
    """Draw the frames of a shot, here or on a cluster."""
    from pe_runtime.environment import PlayableEnvironment
    from pe_runtime.shots import RenderCancelledError, load_shot
    from pe_runtime.shots.files import draw_missing, plan_frames

    drawing = draw_missing if cluster is None else drawing_on(cluster)
    job, wanted = load_shot(shot), None if frames is None else parse_frames(frames)
    environment = PlayableEnvironment.load(job.model, device())
    try:
        with progress("frames") as report, stop_on_interrupt() as stopped:
            plan = plan_frames(environment, job, out, wanted, resume)
            done = drawing(environment, plan, report, stopped)
    except RenderCancelledError as cancelled:
        note(f"{out}: {cancelled}; they are there, the same command draws the others")
        raise typer.Exit(EXIT_CODE) from None
    video = join_frames(out, wanted or list(job.frames), job.fps, "render.mp4") if mp4 else None
    show(frames_result(out, done) | {"video": video}, frames_summary(out, done, video))


def frames_result(out: Path, done: Any) -> dict[str, Any]:  # noqa: ANN401 a RenderReport
    """What was drawn, as JSON values."""
    return {
        "folder": str(out),
        "written": list(done.written),
        "kept": list(done.kept),
        "seconds": round(done.seconds, 3),
    }


def frames_summary(out: Path, done: Any, video: str | None) -> str:  # noqa: ANN401 a RenderReport
    """What was drawn, in a line or two."""
    drawn, kept = len(done.written), len(done.kept)
    rate = f", {drawn / done.seconds:.2f} frames a second" if drawn else ""
    also = f"\nvideo: {video}" if video else ""
    return f"{out}: {drawn} frames drawn, {kept} kept, {done.seconds:.1f} s{rate}{also}"


def join_frames(out: Path, frames: list[int], fps: float, name: str) -> str:
    """Join frames of a folder into a film there, and say where it is."""
    from pe_runtime.shots import frame_path
    from pe_runtime.shots.video import write_video

    write_video([frame_path(out, frame) for frame in sorted(set(frames))], fps, out / name)
    return str(out / name)


def _write_text(path: Path, text: str) -> None:
    """Write a small file whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.part")
    unfinished.write_text(text)
    unfinished.replace(path)
