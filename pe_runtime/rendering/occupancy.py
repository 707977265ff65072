"""Where an object has anything at all: a coarse look at this very frame's density.

The grid lies in the object's own box and is evaluated anew for every pose, through ray bending,
so it is never out of date. A sample is worth evaluating if a grid point near it is dense enough.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from pe_runtime.rendering.folded_field import FoldedField
from pe_runtime.rendering.scene import RenderSettings

CELLS = (12, 12, 16)
"""Grid points along x, y and z of a volume."""

EMPTY = 2e-3
"""Optical thickness of a grid cell below which nothing is there."""


def occupied(
    field: FoldedField,
    coordinates: Float[Tensor, "hits samples 3"],
    settings: RenderSettings,
) -> Bool[Tensor, "hits samples"] | None:
    """Whether there may be something at samples; None where a look would cost more than it saves.

    Args:
        field: The object's, in its present state.
        coordinates: Samples in half box sizes.
        settings: Sampling.
    """
    del settings
    count = CELLS[0] * CELLS[1] * CELLS[2]
    if coordinates[..., 0].numel() < 2 * count:
        return None
    grid = dense_cells(field, coordinates.device)
    cells = torch.tensor(CELLS, device=coordinates.device)
    at = ((coordinates + 1) / 2 * cells).long().clamp_(min=0)
    at = torch.minimum(at, cells - 1)
    flat = (at[..., 0] * CELLS[1] + at[..., 1]) * CELLS[2] + at[..., 2]
    return grid.flatten()[flat]


def dense_cells(field: FoldedField, device: torch.device) -> Bool[Tensor, "x y z"]:
    """Cells that are dense in their middle, or beside one that is."""
    axes = [(torch.arange(n, device=device) + 0.5) / n * 2 - 1 for n in CELLS]
    points = torch.stack(torch.meshgrid(*axes, indexing="ij"), dim=-1).reshape(-1, 3)
    _, density = field.geometry(points)
    config = field.config
    size = min((b - a) / n for a, b, n in zip(config.low, config.high, CELLS, strict=True))
    dense = (density * size > EMPTY).float().reshape(1, 1, *CELLS)
    return torch.nn.functional.max_pool3d(dense, 3, 1, 1)[0, 0] > 0
