"""Inputs of a convolution for a part of a map: values around it, doubled and reflected as needed.

A part of a map gets the very numbers that the whole map gets, bit for bit: sums and products are
those of the whole map's coordinates, only fewer.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import torch
from jaxtyping import Float
from torch import Tensor

from pe_runtime.rendering.regions import Region

_Shares = tuple[float, float] | tuple[Tensor, Tensor]


@dataclass(frozen=True)
class Source:
    """One of the inputs that a convolution sees side by side.

    Attributes:
        index: Which value: the feature maps first, then what each step gave.
        channels: How many of its channels, from the first.
        doubling: None, or how its resolution is doubled bilinearly: "edges" puts the outer edges of
            the corner cells on each other (`align_corners=False`), "corners" their centres.
        activated: Whether a ReLU comes first.
    """

    index: int
    channels: int
    doubling: str | None = None
    activated: bool = False


def extent(source: Source, values: Sequence[Tensor]) -> Region:
    """All cells of a source, after its doubling."""
    height, width = values[source.index].shape[-2:]
    whole = Region(0, 0, height, width)
    return whole.doubled() if source.doubling else whole


def gathered(
    sources: Sequence[Source],
    values: Sequence[Tensor],
    region: Region,
    radius: int,
    spare: int,
    dtype: torch.dtype,
) -> Float[Tensor, "1 channels height width"]:
    """The sources' channels of a region and a margin around it, channels last in memory.

    Args:
        sources: What to put side by side.
        values: Maps and results of steps, each of shape (1, channels, height, width).
        region: Cells in question, after doubling.
        radius: Width of the margin; reflected where it leaves the map.
        spare: Columns of zeros at the right of all that.
        dtype: Of the result.
    """
    within = extent(sources[0], values)
    whole = region.grown(radius, within)
    rows, columns = region.height + 2 * radius, region.width + 2 * radius
    channels = sum(each.channels for each in sources)
    device = values[sources[0].index].device
    gathered = torch.empty(rows, columns + spare, channels, dtype=dtype, device=device)
    top, left = whole.top - region.top + radius, whole.left - region.left + radius
    start = 0
    for source in sources:
        stop = start + source.channels
        target = gathered[top : top + whole.height, left : left + whole.width, start:stop]
        value = values[source.index].permute(0, 2, 3, 1)[0, :, :, : source.channels]
        if source.doubling:
            _double(value, source, whole, target)
        else:
            _copy(value[whole.top : whole.bottom, whole.left : whole.right], source, target)
        start = stop
    inside = gathered[:, :columns] if spare else gathered
    _reflect(inside, top, rows - top - whole.height)
    _reflect(inside.transpose(0, 1), left, columns - left - whole.width)
    if spare:
        gathered[:, columns:] = 0
    return gathered.permute(2, 0, 1)[None]


def _copy(cells: Tensor, source: Source, target: Tensor) -> None:
    if source.activated:
        torch.clamp_min(cells, 0, out=target)
    else:
        target.copy_(cells)


def _reflect(rows: Tensor, before: int, after: int) -> None:
    """Fill the first and the last rows with their mirror images about the rows next to them."""
    for distance in range(1, before + 1):
        rows[before - distance] = rows[before + distance]
    last = rows.shape[0] - after - 1
    for distance in range(1, after + 1):
        rows[last + distance] = rows[last - distance]


def _double(value: Tensor, source: Source, region: Region, target: Tensor) -> None:
    """Write a region of the doubled map, rows x columns x channels."""
    height, width, _ = value.shape
    coarse = Region(
        region.top // 2 - 1,
        region.left // 2 - 1,
        (region.bottom - 1) // 2 + 2,
        (region.right - 1) // 2 + 2,
    )
    cells = _clamped(value, coarse, source, target.dtype)
    corners = source.doubling == "corners"
    wide = target.new_empty(coarse.height, region.width, source.channels)
    shares = _shares(width, corners, target.dtype, target.device)
    _blend(cells.transpose(0, 1), region.left, shares, wide.transpose(0, 1))
    shares = _shares(height, corners, target.dtype, target.device)
    _blend(wide, region.top, shares, target)


def _clamped(value: Tensor, region: Region, source: Source, dtype: torch.dtype) -> Tensor:
    """The cells of a region; beyond the map, those at its border."""
    height, width, _ = value.shape
    inside = region.grown(0, Region(0, 0, height, width))
    cells = value.new_empty(region.height, region.width, source.channels, dtype=dtype)
    top, left = inside.top - region.top, inside.left - region.left
    target = cells[top : top + inside.height, left : left + inside.width]
    _copy(value[inside.top : inside.bottom, inside.left : inside.right], source, target)
    for each, before, after in (
        (cells, top, region.bottom - inside.bottom),
        (cells.transpose(0, 1), left, region.right - inside.right),
    ):
        if before:
            each[0] = each[1]
        if after:
            each[-1] = each[-2]
    return cells


def _blend(cells: Tensor, start: int, shares: _Shares, target: Tensor) -> None:
    """Rows of twice as many: row 2i between i - 1 and i, row 2i + 1 between i and i + 1.

    Args:
        cells: Rows from `start // 2 - 1` on.
        start: First of the doubled rows to write.
        shares: The later row's share in even and in odd rows: one for all, or one by i.
        target: Doubled rows.
    """
    stop = start + target.shape[0]
    for odd, share in enumerate(shares):
        first = (start - odd + 1) // 2
        rows = (stop - odd + 1) // 2 - first
        at = first - (start // 2 - 1) - 1 + odd
        weight = share if isinstance(share, float) else share[first : first + rows, None, None]
        begin = 2 * first + odd - start
        torch.lerp(
            cells[at : at + rows], cells[at + 1 : at + 1 + rows], weight, out=target[begin::2]
        )


@lru_cache(maxsize=64)
def _shares(rows: int, corners: bool, dtype: torch.dtype, device: torch.device) -> _Shares:
    if not corners:
        # A number, not a tensor of equal numbers: five times as fast in bfloat16.
        return 0.75, 0.25
    index = torch.arange(rows, dtype=torch.float64, device=device)
    even, odd = 1 - index / (2 * rows - 1), (rows - 1 - index) / (2 * rows - 1)
    return even.to(dtype), odd.to(dtype)
