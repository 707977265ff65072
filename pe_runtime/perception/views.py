"""What an encoder is told about the view: where the camera stands and how it looks.

The pose lives in the world's axes while a crop shows it in the camera's, so E must know the view (a
deviation from the paper, as in its authors' release).
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor

from pe_runtime.config import EncoderConfig
from pe_runtime.geometry.cameras import Cameras
from pe_runtime.geometry.native_world import WORLD_FROM_NATIVE, euler_from_rotation

VIEW_FEATURES = 6


def view_size(encoder: EncoderConfig) -> int:
    """How many numbers about the view an encoder takes."""
    return 0 if encoder.view == "none" else VIEW_FEATURES


def view_features(
    cameras: Cameras, positions: Float[Tensor, "frames 3"], regions: Float[Tensor, "frames 4"]
) -> Float[Tensor, "frames 6"]:
    """How the object is seen: unit direction from the camera (world), and the region's size."""
    away = positions.double() - cameras.centres
    away = away / away.norm(dim=-1, keepdim=True).clamp(min=1e-9)
    middle = (regions[:, 0] + regions[:, 2]) / (2 * cameras.width) - 0.5
    size = torch.stack(
        [
            (regions[:, 2] - regions[:, 0]) / cameras.width,
            (regions[:, 3] - regions[:, 1]) / cameras.height,
            middle,
        ],
        dim=-1,
    )
    return torch.cat([away.float(), size.float()], dim=-1)


def camera_angles(cameras: Cameras, native_up: str) -> Float[Tensor, "frames 3"]:
    """Euler angles (a, b, c) of the cameras, radians, float64, as `rotation_from_euler` takes them.

    They are those of a camera that looks along its -z with y up, in the native world.
    """
    native_from_world = WORLD_FROM_NATIVE[native_up].to(cameras.rotations.device).T
    # The columns of ours are the camera's right, down and forward.
    flip = cameras.rotations.new_tensor([1.0, -1.0, -1.0])
    return euler_from_rotation(native_from_world @ cameras.rotations * flip)


def camera_features(
    cameras: Cameras, native_up: str, middles: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Float[Tensor, "frames 6"]:
    """The cameras' Euler angles (radians) and positions (metres) in the native world.

    Args:
        cameras: One camera per frame.
        native_up: Up axis of the native world, "z" or "y".
        middles: The middle of the whole turn within which each angle is told, radians.
    """
    angles = camera_angles(cameras, native_up)
    turns = torch.round((angles.new_tensor(middles) - angles) / math.tau)
    native = cameras.centres @ WORLD_FROM_NATIVE[native_up].to(cameras.centres)
    return torch.cat([angles + math.tau * turns, native], dim=-1).float()
