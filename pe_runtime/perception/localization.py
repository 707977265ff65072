"""Where an object stands: box and camera -> position on the ground (paper, Sec. 3)."""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from pe_runtime.geometry.cameras import Cameras, ground_from_pixels


def locate(
    cameras: Cameras,
    boxes: Float[Tensor, "frames objects 4"],
    foot_offset: float = 0.0,
    lift: float = 0.0,
) -> tuple[Float[Tensor, "frames objects 3"], Bool[Tensor, "frames objects"]]:
    """Project the middle of each box's lower edge onto the ground plane.

    Args:
        cameras: One camera per frame.
        boxes: (left, top, right, bottom) in pixels; NaN where the object was not found.
        foot_offset: Metres by which the point is pushed on, away from the camera: a box ends at
            the near side of the feet, while the position is the middle of the body.
        lift: Metres above the ground at which the objects stand.

    Returns:
        Positions (metres, z = lift; zeros where there is none) and whether each is a position at
        all: not for absent or degenerate boxes, nor for feet at or above the horizon.
    """
    proper = torch.isfinite(boxes).all(dim=-1)
    proper = proper & (boxes[..., 2] > boxes[..., 0]) & (boxes[..., 3] > boxes[..., 1])
    safe = torch.where(proper[..., None], boxes, 0.0)
    feet = torch.stack([(safe[..., 0] + safe[..., 2]) / 2, safe[..., 3]], dim=-1)
    ground, meets = ground_from_pixels(cameras, feet)
    if foot_offset:
        away = ground[..., :2] - cameras.centres[:, None, :2]
        away = away / away.norm(dim=-1, keepdim=True).clamp(min=1e-9)
        ground = torch.cat([ground[..., :2] + foot_offset * away, ground[..., 2:]], dim=-1)
    if lift:
        ground = torch.cat([ground[..., :2], torch.full_like(ground[..., 2:], lift)], dim=-1)
    valid = proper & meets
    return torch.where(valid[..., None], ground, 0.0).float(), valid
