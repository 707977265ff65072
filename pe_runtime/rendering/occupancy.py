"""Where an object has anything at all: a coarse look at this very frame's density.

The grid lies in the object's own box and is evaluated anew for every pose, through ray bending,
so it is never out of date. A sample is worth evaluating if a grid point near it is dense enough.
"""

import functools

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from pe_runtime.rendering.folded_field import FoldedField

CELLS = (10, 10, 14)
"""Grid points along x, y and z of a volume."""

EMPTY = 1e-2
"""Optical thickness of a grid cell below which nothing is there."""


def occupied(
    field: FoldedField,
    coordinates: Float[Tensor, "3 hits samples"],
    always: bool = False,
) -> Bool[Tensor, "hits samples"] | None:
    """Whether there may be something at samples; None where a look would cost more than it saves.

    Args:
        field: The object's, in its present state.
        coordinates: Samples in half box sizes.
        always: Look whatever it costs: for a part of a picture, which is to be as in the whole.
    """
    count = CELLS[0] * CELLS[1] * CELLS[2]
    if not always and coordinates[0].numel() < 2 * count:
        return None
    # One more cell at the upper end of each axis, for samples right on the face.
    grid = torch.nn.functional.pad(dense_cells(field, coordinates.device), (0, 1) * 3)
    grid[-1], grid[:, -1], grid[..., -1] = grid[-2], grid[:, -2], grid[..., -2]
    cell = torch.zeros_like(coordinates[0])
    for along, cells, stride in zip(coordinates, CELLS, grid.stride(), strict=True):
        # Small whole numbers: exact in float32, and faster than integers.
        cell.add_(torch.add(along, 1).mul_(cells / 2).floor_(), alpha=stride)
    return grid.flatten().take(cell.long())


def dense_cells(field: FoldedField, device: torch.device) -> Bool[Tensor, "x y z"]:
    """Cells that are dense in their middle, or share a face with one that is."""
    points = _middles(device)
    _, density = field.geometry(points)
    config = field.config
    size = min((b - a) / n for a, b, n in zip(config.low, config.high, CELLS, strict=True))
    dense = (density * size > EMPTY).reshape(CELLS)
    near = dense.clone()
    near[1:] |= dense[:-1]
    near[:-1] |= dense[1:]
    near[:, 1:] |= dense[:, :-1]
    near[:, :-1] |= dense[:, 1:]
    near[..., 1:] |= dense[..., :-1]
    near[..., :-1] |= dense[..., 1:]
    return near


@functools.lru_cache(maxsize=4)
def _middles(device: torch.device) -> Float[Tensor, "cells 3"]:
    """The middles of all cells, in half box sizes."""
    axes = [(torch.arange(n, device=device) + 0.5) / n * 2 - 1 for n in CELLS]
    return torch.stack(torch.meshgrid(*axes, indexing="ij"), dim=-1).reshape(-1, 3)
