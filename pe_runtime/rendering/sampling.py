"""Where rays are shot and where along them the fields are asked."""

import torch
from jaxtyping import Float
from torch import Tensor


def grid_pixels(
    top: int, left: int, height: int, width: int, stride: int
) -> Float[Tensor, "rays 2"]:
    """Pixel positions (u, v) of the rays of one feature map, row by row.

    Args:
        top: First pixel row of the covered image region.
        left: First pixel column.
        height: Rows of the region in pixels; a multiple of the stride.
        width: Columns of the region in pixels; a multiple of the stride.
        stride: Pixels per ray; each ray passes through the centre of its stride x stride block.
    """
    v = top + stride * (torch.arange(height // stride, dtype=torch.float64) + 0.5)
    u = left + stride * (torch.arange(width // stride, dtype=torch.float64) + 0.5)
    rows, columns = torch.meshgrid(v, u, indexing="ij")
    return torch.stack([columns, rows], dim=-1).reshape(-1, 2)


def sample_intervals(
    near: Float[Tensor, " rays"],
    far: Float[Tensor, " rays"],
    count: int,
    jitter: Float[Tensor, "rays samples"] | None = None,
) -> tuple[Float[Tensor, "rays samples"], Float[Tensor, " rays"]]:
    """Cut [near, far] into equal intervals and take one sample in each.

    Args:
        near: Entry parameters.
        far: Exit parameters.
        count: Samples per ray.
        jitter: Place of each sample within its interval, in [0, 1); None takes the middle.

    Returns:
        Sample parameters, nearest first, and the interval length of each ray.
    """
    step = (far - near) / count
    index = torch.arange(count, device=near.device, dtype=near.dtype)
    place = index + 0.5 if jitter is None else index + jitter
    return near[:, None] + place * step[:, None], step
