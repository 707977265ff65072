"""Where pictures of a model's world are usually taken from, for those who know no better."""

from dataclasses import dataclass

import numpy as np

from pe_runtime.config import ModelConfig
from pe_runtime.config.objects import Triple
from pe_runtime.contract.camera import Camera


@dataclass(frozen=True)
class View:
    """A level camera, environment space.

    Attributes:
        eye: Where it stands, metres.
        target: What it looks at, metres.
        field_of_view: Horizontal, degrees.
    """

    eye: Triple
    target: Triple
    field_of_view: float


KNOWN_VIEWS = {
    "official-tennis": View((0.0, -38.9, 8.5), (0.0, 4.5, 0.0), 24.6),
    "official-minecraft": View((0.0, -9.3, 3.6), (0.0, 0.0, 0.4), 76.0),
}
"""By the model's own name: the middle of what such pictures were taken with."""


def usual_camera(config: ModelConfig) -> Camera:
    """The usual camera of a model's world, at the size of its pictures."""
    view = KNOWN_VIEWS.get(config.name) or _before_the_players(config)
    eye, target = np.array(view.eye), np.array(view.target)
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = eye
    width, height = config.width, config.height
    focal = width / 2 / np.tan(np.radians(view.field_of_view) / 2)
    intrinsics = np.array([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]])
    return Camera(width, height, intrinsics, pose)


def _before_the_players(config: ModelConfig) -> View:
    """In front of where players roam and above them, as the built-in model's pictures are taken."""
    reach = max(config.action.position_scale[:2])
    return View((0.0, -2.125 * reach, 0.65 * reach), (0.0, 0.0, 1.0), 50.0)
