"""Models with something to draw: built in, from a file, or seeded."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pe_runtime.benchmark.seeded import SEEDED_TENNIS, seeded_tennis
from pe_runtime.config import ModelConfig
from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ShotError
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.geometry.cameras import Cameras, ground_from_pixels
from pe_runtime.shots.clips import STATE_CAMERA, sample_clip, start_from
from pe_runtime.shots.rollout import start_state
from pe_runtime.state import EnvironmentState, ObjectState, state_as_dict
from pe_runtime.worker.usual_cameras import usual_camera

LEFT_AND_NEAR, RIGHT_AND_FAR = (0.35, 0.75), (0.65, 0.35)
"""Places in the picture, as shares of its width and height, between which players stand who were
not found in one."""


@dataclass(frozen=True)
class Scene:
    """A model with a state and a camera to begin from."""

    environment: PlayableEnvironment
    state: EnvironmentState
    camera: Camera


def open_scene(model: str, start: str | Path | None, device: str) -> Scene:
    """Load a model and find something for it to draw.

    Args:
        model: Built-in name, file, or "seeded-tennis".
        start: Clip or state file; None for the clip beside the model's file, and where there is
            none, for seeded codes seen by the model's usual camera.
        device: "cpu", "cuda" or "auto".

    Raises:
        CheckpointError: There is no such model.
        ShotError: The start is none.
    """
    if model == SEEDED_TENNIS:
        environment = seeded_tennis("cpu" if device == "auto" else device)
    else:
        environment = PlayableEnvironment.load(model, device)
        start = start or _clip_beside(model)
    if start is None:
        camera = usual_camera(environment.config)
        return Scene(environment, seeded_state(environment.config, camera), camera)
    begin, camera = start_from(start)
    return Scene(environment, start_state(environment, begin), camera)


def store_scene(scene: Scene, path: Path) -> None:
    """Write state and camera so that `open_scene` starts from these very numbers."""
    content = state_as_dict(scene.state) | {STATE_CAMERA: scene.camera.as_dict()}
    path.write_text(json.dumps(content))


def seeded_state(config: ModelConfig, camera: Camera, seed: int = 0) -> EnvironmentState:
    """Static objects in their places, players before the camera, all with seeded codes."""
    generator = torch.Generator().manual_seed(seed)
    standing = iter(ground_places(camera, len(config.playable_names)))
    objects = {}
    for each in config.objects:
        kind = config.classes[each.class_name]
        place = next(standing) if kind.kind == "playable" else torch.tensor(each.position)
        style = torch.randn(kind.style_features, generator=generator)
        pose = torch.randn(kind.pose_features, generator=generator)
        objects[each.name] = ObjectState(place + torch.tensor([0.0, 0.0, kind.lift]), style, pose)
    return EnvironmentState(objects)


def ground_places(
    camera: Camera,
    count: int,
    first: tuple[float, float] = LEFT_AND_NEAR,
    last: tuple[float, float] = RIGHT_AND_FAR,
) -> list[Float[Tensor, "3"]]:
    """Points on the ground that the camera sees in a straight line, metres.

    Args:
        camera: Who sees them.
        count: How many.
        first: Place of the first in the picture, shares of its width and height.
        last: Place of the last.
    """
    places = np.linspace(first, last, max(count, 2))[:count] * (camera.width, camera.height)
    points, meets = ground_from_pixels(Cameras.stack([camera]), torch.from_numpy(places)[None])
    # Above the horizon there is no ground; the world's middle will do.
    return [p.float() if ok else torch.zeros(3) for p, ok in zip(points[0], meets[0], strict=True)]


def _clip_beside(model: str) -> Path | None:
    try:
        return sample_clip(model)
    except ShotError:
        return None
