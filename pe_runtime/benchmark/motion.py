"""Short films of a scene: what changes from frame to frame is what a renderer may not reuse."""

import math
from collections.abc import Callable, Mapping

import numpy as np
import torch
from torch import Tensor

from pe_runtime.benchmark.scenes import Scene, ground_places
from pe_runtime.contract.camera import Camera
from pe_runtime.play.camera_moves import CameraMove, moved_camera
from pe_runtime.state import EnvironmentState, change

ORBIT, TURN = 0.5, 24
"""Degrees that the camera turns about the middle from frame to frame, and frames after which it
turns back: a film that goes all around shows other sides, which cost what they cost."""
WALK, LAP = 0.5, 96
"""Players walk round circles of this radius (metres) in so many frames."""
SWAY, BEAT = 0.1, 24
"""Pose codes swing by this share of their size in so many frames."""


Moment = tuple[EnvironmentState, Camera]


def moving(scene: Scene, frame: int) -> Moment:
    """The camera orbits what it looks at, to and fro; players walk."""
    middle = ground_places(scene.camera, 1, (0.5, 0.5))[0].double().numpy()
    camera = moved_camera(scene.camera, middle, CameraMove(orbit=ORBIT * _swing(frame)))
    return standing(scene, frame)[0], camera


def standing(scene: Scene, frame: int) -> Moment:
    """The camera stands; players walk."""
    state = scene.state
    for name in scene.environment.playable_names:
        own = state[name]
        position = own.position + _step(frame)
        state = change(state, name, position=position, pose=_swaying(own.pose, frame))
    return state, scene.camera


def still(scene: Scene, frame: int) -> Moment:
    """Nothing changes."""
    return scene.state, scene.camera


FILMS: Mapping[str, Callable[[Scene, int], Moment]] = {
    "moving": moving,
    "standing": standing,
    "still": still,
}


def film(scene: Scene, kind: str, frames: int) -> list[Moment]:
    """State and camera of each frame; frame 0 is the scene as it is."""
    return [FILMS[kind](scene, frame) for frame in range(frames)]


def _swing(frame: int) -> int:
    """To and fro: 0, 1, .. TURN, .. 1, 0, -1, .. -TURN, .. 0; no place comes again at once."""
    return TURN - abs((frame + TURN) % (4 * TURN) - 2 * TURN)


def _step(frame: int) -> Tensor:
    angle = math.tau * frame / LAP
    return WALK * torch.tensor([math.sin(angle), 1.0 - math.cos(angle), 0.0])


def _swaying(pose: Tensor, frame: int) -> Tensor:
    if pose.numel() == 0:
        return pose
    direction = torch.from_numpy(np.random.default_rng(0).standard_normal(pose.numel())).float()
    size = SWAY * pose.square().mean().sqrt() * math.sin(math.tau * frame / BEAT)
    return pose + size * direction
