"""Resample picture regions by the maximum in each cell of a grid."""

import torch
from jaxtyping import Float, Int
from torch import Tensor

EMPTY = 0.5
"""Value of a cell that lies outside the picture: mid-grey, zero once pixels are in [-1, 1]."""

FARTHEST = 1e9
"""Pixels beyond which a region's edge is no farther away; keeps integers from overflowing."""


def max_pool_regions(
    images: Float[Tensor, "frames channels rows columns"],
    regions: Float[Tensor, "frames 4"],
    height: int,
    width: int,
) -> Float[Tensor, "frames channels height width"]:
    """Maximum of the pixels in each cell of a grid over one region per picture.

    Edges are rounded to whole pixels, halves away from zero, and both edge pixels belong to the
    region, which is thus one pixel wide at least. Cells overlap where the grid does not divide the
    region: each begins at the pixel in which its exact start lies and ends after that of its exact
    end. They are then clipped to the picture; cells without a pixel are `EMPTY`.

    Args:
        images: Pixels in [0, 1].
        regions: (left, top, right, bottom) in pixels, finite; may leave the picture.
        height: Rows of the grid.
        width: Columns of the grid.
    """
    rows = _cells(regions[:, 1], regions[:, 3], height, images.shape[-2])
    columns = _cells(regions[:, 0], regions[:, 2], width, images.shape[-1])
    pooled = _maxima(images.transpose(-1, -2), *rows).transpose(-1, -2)
    pooled = _maxima(pooled, *columns)
    filled = (rows[1] > rows[0])[:, :, None] & (columns[1] > columns[0])[:, None, :]
    return torch.where(filled[:, None], pooled, EMPTY)


def _cells(
    low: Float[Tensor, " frames"], high: Float[Tensor, " frames"], cells: int, extent: int
) -> tuple[Int[Tensor, "frames cells"], Int[Tensor, "frames cells"]]:
    """First pixel of each cell along one axis, and the one after its last."""
    first, last = _round(low), _round(high)
    # The products are taken in float32: the paper's authors' networks saw its roundings.
    size = (last - first + 1).clamp(min=1).float() / cells
    index = torch.arange(cells, device=low.device, dtype=torch.float32)
    start = torch.floor(index * size[:, None]).long() + first[:, None]
    stop = torch.ceil((index + 1) * size[:, None]).long() + first[:, None]
    return start.clamp(0, extent), stop.clamp(0, extent)


def _round(edges: Float[Tensor, " frames"]) -> Int[Tensor, " frames"]:
    """Nearest whole pixel, halves away from zero (torch.round would go to the even one)."""
    exact = edges.float().double().clamp(-FARTHEST, FARTHEST)
    return (torch.sign(exact) * torch.floor(exact.abs() + 0.5)).long()


def _maxima(
    values: Float[Tensor, "frames channels lines pixels"],
    start: Int[Tensor, "frames cells"],
    stop: Int[Tensor, "frames cells"],
) -> Float[Tensor, "frames channels lines cells"]:
    """Maximum over [start, stop) of each line; anything where that is empty.

    Tables hold the maxima of all runs of 1, 2, 4, ... pixels. Two such runs, which may overlap,
    cover any range, so that the memory does not grow with a region's size.
    """
    pixels = values.shape[-1]
    # frexp is exact: a mantissa in [0.5, 1) makes the exponent one more than floor(log2).
    level = torch.frexp((stop - start).clamp(min=1).double()).exponent.long() - 1
    tables = [values]
    for exponent in range(int(level.max()) if level.numel() else 0):
        known, run = tables[-1], 1 << exponent
        longer = torch.maximum(known[..., :-run], known[..., run:])
        tables.append(torch.cat([longer, known[..., -run:]], dim=-1))
    flat = torch.cat(tables, dim=-1)
    ends = [start.clamp(max=pixels - 1), (stop - (1 << level)).clamp(min=0)]
    picks = [
        torch.gather(flat, -1, _across(level * pixels + end, values.shape[1:3])) for end in ends
    ]
    return torch.maximum(*picks)


def _across(
    index: Int[Tensor, "frames cells"], lines: torch.Size
) -> Int[Tensor, "frames channels lines cells"]:
    return index[:, None, None, :].expand(-1, *lines, -1)
