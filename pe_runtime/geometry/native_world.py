"""Worlds with another up axis than ours, and orientations as Euler angles in them.

States and cameras are Z-up everywhere. Networks that were trained in a world with y up still want
to be told camera angles in theirs, and files of such worlds have to be read.

        native "y"                    ours
        y  up                         z  up
        |                             |   y = -z of theirs
        |____ x                       |  /
       /                              | /____ x
      z
"""

from types import MappingProxyType

import torch
from jaxtyping import Float
from torch import Tensor

LOCK = 1e-9
"""Cosine of the x angle below which the other two angles turn about the same axis."""

_Y_UP = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))
WORLD_FROM_NATIVE = MappingProxyType(
    {
        "z": torch.eye(3, dtype=torch.float64),
        "y": torch.tensor(_Y_UP, dtype=torch.float64),
    }
)
"""Rotation from the native world to ours, by the native up axis."""


def rotation_from_euler(angles: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3 3"]:
    """R = Ry(b) Rx(a) Rz(c): about z first, then x, then y.

    Args:
        angles: (a, b, c) about x, y and z, radians.
    """
    (a, b, c), zero = angles.unbind(-1), torch.zeros_like(angles[..., 0])
    one = zero + 1

    def matrix(*rows: Tensor) -> Tensor:
        return torch.stack(rows, dim=-1).unflatten(-1, (3, 3))

    about_x = matrix(one, zero, zero, zero, a.cos(), -a.sin(), zero, a.sin(), a.cos())
    about_y = matrix(b.cos(), zero, b.sin(), zero, one, zero, -b.sin(), zero, b.cos())
    about_z = matrix(c.cos(), -c.sin(), zero, c.sin(), c.cos(), zero, zero, zero, one)
    return about_y @ about_x @ about_z


def euler_from_rotation(rotation: Float[Tensor, "*batch 3 3"]) -> Float[Tensor, "*batch 3"]:
    """The angles (a, b, c) of R = Ry(b) Rx(a) Rz(c), with |a| <= pi/2, radians.

    At |a| = pi/2 only a sum or difference of b and c is determined; c is 0 there.
    """
    a = torch.asin((-rotation[..., 1, 2]).clamp(-1.0, 1.0))
    locked = torch.hypot(rotation[..., 0, 2], rotation[..., 2, 2]) < LOCK
    b = torch.where(
        locked,
        torch.atan2(-rotation[..., 2, 0], rotation[..., 0, 0]),
        torch.atan2(rotation[..., 0, 2], rotation[..., 2, 2]),
    )
    c = torch.atan2(rotation[..., 1, 0], rotation[..., 1, 1])
    return torch.stack([a, b, torch.where(locked, torch.zeros_like(c), c)], dim=-1)
