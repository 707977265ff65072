"""Takes as Shots, the one document `pe render` repeats, and their frames on disk."""

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.shot import SHOT_VERSION, ObjectTrack, Shot, StyleMix
from pe_runtime.images import read_metadata, write_png
from pe_runtime.play.camera_moves import CameraMove, moved_camera
from pe_runtime.play.session import Session
from pe_runtime.play.stage import Stage
from pe_runtime.shots.action_text import Runs
from pe_runtime.shots.clips import shot_of_actions
from pe_runtime.shots.files import DIGEST_KEY, frame_path
from pe_runtime.shots.frames import frame_digest, frame_state, model_digest, render_options
from pe_runtime.shots.rollout import PreparedShot, Rollout, World, prepare_shot


def shot_of_script(stage: Stage, runs: Runs, move: CameraMove) -> Shot:
    """The shot of written actions, whose camera moves evenly from the first frame to the last.

    Args:
        stage: Model, start and choices.
        runs: Actions per object, in steps; objects without any stand still.
        move: How far the camera has moved at the last frame.
    """
    start = (stage.start, stage.camera)
    shot = shot_of_actions(stage.model, start, runs, stage.fps, stage.steps_per_second)
    last = max(len(shot.frames) - 1, 1)
    tracks = {track.name: track for track in shot.objects}
    for name, mix in stage.wishes.styles.items():
        track = tracks.get(name, ObjectTrack(name))
        tracks[name] = dataclasses.replace(track, styles=(mix,))
    return dataclasses.replace(
        shot,
        cameras=tuple(_camera(stage, move * (index / last)) for index in range(len(shot.frames))),
        objects=tuple(tracks.values()),
        quality=stage.wishes.quality,
    )


def frames_per_step(stage: Stage) -> int:
    """Frames from one step of a session to the next.

    Raises:
        ShotError: The frame rate is not a multiple of the model's.
    """
    rate, ratio = stage.steps_per_second, stage.fps / stage.steps_per_second
    if ratio < 1 or abs(ratio - round(ratio)) > 1e-6:
        fitting = ", ".join(f"{rate * times:g}" for times in (1, 2, 3, 4, 5))
        raise ShotError(
            f"playing live, a step of the model is a whole number of frames: --fps {fitting} …, "
            f"not {stage.fps:g}; with --actions any rate will do"
        )
    return round(ratio)


def shot_of_session(session: Session) -> Shot:
    """The shot that repeats a session: its actions as keys, its cameras, its styles.

    Between two steps the camera moves evenly.

    Raises:
        ShotError: The frame rate is not a multiple of the model's.
    """
    stage, per_step = session.stage, frames_per_step(session.stage)
    count = 1 + session.steps * per_step
    return Shot(
        version=SHOT_VERSION,
        model=stage.model,
        start=stage.start,
        fps=stage.fps,
        frame_start=1,
        frame_end=count,
        cameras=tuple(_camera(stage, _move_at(session, i, per_step)) for i in range(count)),
        objects=tuple(_tracks(session, per_step)),
        quality=stage.wishes.quality,
    )


def draw_now(world: World, session: Session, folder: Path, model: str) -> tuple[Path, np.ndarray]:
    """Draw the latest moment into its file, as rendering the session's shot would.

    Args:
        world: The loaded environment.
        session: The session.
        folder: Where the frames of the take go.
        model: What `model_digest` says of the world.

    Returns:
        The file, and its picture (height, width, 3) in [0, 1].
    """
    shot = shot_of_session(session)
    frame = shot.frame_end
    alone = Rollout(frame, (session.now.state,))
    prepared = PreparedShot(shot, alone, {None: session.stage.state})
    state = frame_state(prepared, frame)
    picture = world.render(state, shot.camera_at(frame), render_options(shot)).rgb
    path = frame_path(folder, frame)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_png(path, picture, {DIGEST_KEY: frame_digest(model, prepared, frame)})
    return path, picture


def finished_frames(world: World, shot: Shot, folder: Path) -> tuple[int, ...]:
    """Frames of a shot that lie drawn in a folder, with their inputs unchanged since."""
    prepared, model = prepare_shot(world, shot), model_digest(world)
    return tuple(
        frame
        for frame in shot.frames
        if read_metadata(frame_path(folder, frame)).get(DIGEST_KEY)
        == frame_digest(model, prepared, frame)
    )


def write_shot(shot: Shot, folder: Path) -> Path:
    """Write `shot.json` whole or not at all, with absolute paths, so that any folder can hold it.

    Returns:
        The file.
    """

    def absolute(path: str | None) -> str | None:
        return None if path is None else str(Path(path).resolve())

    start = dataclasses.replace(
        shot.start, image=absolute(shot.start.image), state=absolute(shot.start.state)
    )
    model = absolute(shot.model) if Path(shot.model).is_file() else shot.model
    folder.mkdir(parents=True, exist_ok=True)
    unfinished = folder / ".shot.json.part"
    unfinished.write_text(dataclasses.replace(shot, start=start, model=model).to_json())
    return unfinished.replace(folder / "shot.json")


def drop_later_frames(folder: Path, shot: Shot) -> None:
    """Delete the frames of steps that have been undone."""
    for path in folder.glob("*.png"):
        if path.stem.isdecimal() and int(path.stem) > shot.frame_end:
            path.unlink()


def _camera(stage: Stage, move: CameraMove) -> Camera:
    return moved_camera(stage.camera, stage.pivot, move)


def _move_at(session: Session, index: int, per_step: int) -> CameraMove:
    step, part = divmod(index, per_step)
    move = session.moments[step].move
    if part == 0:
        return move
    share = part / per_step
    return move * (1.0 - share) + session.moments[step + 1].move * share


def _tracks(session: Session, per_step: int) -> Iterator[ObjectTrack]:
    """One track per player who has acted or changed its style."""
    for name in session.stage.players:
        actions: list[tuple[int, int]] = []
        styles: list[StyleMix] = []
        for step, moment in enumerate(session.moments):
            # The action that led to a moment was keyed at the moment before it.
            if step and (not actions or actions[-1][1] != moment.told[name]):
                actions.append((1 + (step - 1) * per_step, moment.told[name]))
            worn = moment.styles.get(name, StyleMix(1, None, name, 0.0))
            if worn.weight if not styles else _differs(worn, styles[-1]):
                styles.append(dataclasses.replace(worn, frame=1 + step * per_step))
        if actions or styles:
            yield ObjectTrack(name, tuple(actions), styles=tuple(styles))


def _differs(one: StyleMix, other: StyleMix) -> bool:
    return (one.image, one.object, one.weight) != (other.image, other.object, other.weight)
