"""Shots that start from a recorded clip, a picture, or a state file that knows its camera."""

import json
from pathlib import Path
from typing import Any

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.episode import is_complete, read_dataset, read_episode
from pe_runtime.contract.errors import CameraError, EpisodeError, ShotError
from pe_runtime.contract.shot import ObjectTrack, Shot, Start
from pe_runtime.environment import find_model
from pe_runtime.shots.action_text import Runs, keys_of, steps_of

STATE_CAMERA = "camera"
"""Key of a state file that holds the camera which saw the picture."""


def start_from_clip(clip: str | Path, frame: int = 0, view: int = 0) -> Start:
    """One picture of a clip with its camera and boxes.

    Args:
        clip: An episode's folder, or a data set's, whose first episode is taken.
        frame: Frame of the clip.
        view: Camera of the clip.

    Raises:
        EpisodeError: There is no complete clip.
    """
    folder = Path(clip)
    if not is_complete(folder):
        _, folders = read_dataset(folder)
        if not folders:
            raise EpisodeError(f"{clip} holds no complete clip; record one or give another folder")
        folder = folders[0]
    episode = read_episode(folder)
    arrays = episode.arrays
    boxes = {
        name: tuple(float(edge) for edge in arrays.boxes[view, frame, index])
        for index, name in enumerate(episode.info.objects)
        if arrays.present[view, frame, index]
    }
    return Start(str(episode.frame_path(view, frame)), episode.camera(view, frame), boxes)


def start_from_picture(image: str | Path, camera: str | Path, boxes: str | Path) -> Start:
    """A picture with the camera that took it and the boxes of the players in it.

    Args:
        image: PNG, JPEG or EXR.
        camera: JSON file with width, height, intrinsics and world_from_camera.
        boxes: JSON file with left, top, right, bottom in pixels per playable object.

    Raises:
        ShotError: A JSON file is missing or malformed.
    """
    listed = {"image": str(image), "camera": _read_json(camera), "boxes": _read_json(boxes)}
    try:
        return Start.from_dict(listed, f"{camera}, {boxes}")
    except CameraError as error:
        raise ShotError(str(error)) from error


def sample_clip(model: str | Path) -> Path:
    """The clip that lies beside a model's file, as `duel_clip` beside `duel.safetensors`.

    Raises:
        CheckpointError: There is no such model.
        ShotError: It has no clip.
    """
    file = find_model(model)
    clip = file.with_name(f"{file.stem}_clip")
    if not clip.is_dir():
        raise ShotError(
            f"the model {str(model)!r} has no sample clip beside it ({clip}); say where to start: "
            "a clip's folder, a state file of `pe encode`, or a picture with its camera and boxes"
        )
    return clip


def start_from(path: str | Path) -> tuple[Start, Camera]:
    """A start and its camera from a clip's folder or from a state file of `pe encode`.

    Raises:
        EpisodeError: The folder is no clip.
        ShotError: The file is no state with a camera.
    """
    if Path(path).is_dir():
        start = start_from_clip(path)
        return start, start.camera
    try:
        camera = json.loads(Path(path).read_text())[STATE_CAMERA]
        return Start(state=str(path)), Camera.from_dict(camera, f"{path}: camera")
    except (OSError, ValueError, KeyError, TypeError, CameraError) as error:
        raise ShotError(
            f"{path} is neither a clip's folder nor a state file with a camera ({error!r}); "
            "write one with `pe encode`, or start from a picture with its camera and boxes"
        ) from error


def shot_of_actions(
    model: str, start: tuple[Start, Camera], runs: Runs, fps: float, steps_per_second: float
) -> Shot:
    """A shot with a standing camera that lasts as long as its actions.

    Args:
        model: Name or path of the model.
        start: The start and the camera that films.
        runs: Actions per object, in steps.
        fps: Frames per second.
        steps_per_second: Rate of the model.
    """
    picture, camera = start
    frames_per_step = fps / steps_per_second
    count = 1 + int(steps_of(runs) * frames_per_step + 1e-6)
    return Shot(
        version=1,
        model=model,
        start=picture,
        fps=fps,
        frame_start=1,
        frame_end=count,
        cameras=(camera,) * count,
        objects=tuple(
            ObjectTrack(name, keys_of(run, 1, frames_per_step)) for name, run in runs.items()
        ),
    )


def _read_json(path: str | Path) -> Any:  # noqa: ANN401 any JSON value
    try:
        return json.loads(Path(path).read_text())
    except (OSError, ValueError) as error:
        raise ShotError(f"cannot read {path} as JSON ({error})") from error
