"""A part of a picture from the parts of the feature maps that it is made of.

The part has the numbers that it has in the whole picture: it is computed in the whole's
coordinates, reflected only where the whole is.
"""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from pe_runtime.rendering.gathering import Source
from pe_runtime.rendering.partial_decoding import cells_of, value_of
from pe_runtime.rendering.prepared_renderer import PreparedRenderer
from pe_runtime.rendering.regions import Region


def needed_regions(
    renderer: PreparedRenderer, size: tuple[int, int], part: Region
) -> tuple[Region, ...]:
    """Which cells of each value go into a part of the picture.

    Args:
        renderer: From `prepared`.
        size: Height and width of the whole picture, pixels.
        part: The pixels that are wanted.

    Returns:
        A region per value: the feature maps, finest first, then what each step gives.
    """
    extents = _extents(renderer, size)
    needed: list[Region | None] = [None] * len(extents)
    needed[-1] = part
    maps = len(renderer.config.strides)
    for index in range(len(extents) - 1, maps - 1, -1):
        step = renderer.steps[index - maps]
        own = needed[index]
        if step.convolution and step.convolution.together > 1:
            # What is computed together stays together. Elsewhere it would only cost: the margins
            # of a dozen steps would grow by up to a grid cell each.
            own = needed[index] = own.aligned(extents[index])
        radius = step.convolution.radius if step.convolution else 0
        seen = own.grown(radius, extents[index])
        for source in step.sources:
            cells = _read_by(seen, source).grown(0, extents[source.index])
            needed[source.index] = _with(needed[source.index], cells)
        if step.plus is not None:
            needed[step.plus] = _with(needed[step.plus], own)
    return tuple(needed)


@torch.inference_mode()
def decode_part(
    renderer: PreparedRenderer,
    maps: Sequence[Float[Tensor, "1 _ _ _"]],
    needed: Sequence[Region],
) -> Float[Tensor, "3 height width"]:
    """Decode a part of a picture in [0, 1].

    Args:
        renderer: From `prepared`.
        maps: Whole maps, finest first, of which only the needed cells are read.
        needed: From `needed_regions`.

    Returns:
        A picture of the whole size in which the last of the needed regions is right and all else
        is undefined.
    """
    values = list(maps)
    stride = renderer.config.strides[0]
    size = tuple(n * stride for n in maps[0].shape[-2:])
    extents = _extents(renderer, size)
    for step, region, extent in zip(
        renderer.steps, needed[len(maps) :], extents[len(maps) :], strict=True
    ):
        part = value_of(step, values, region, renderer.dtype)
        whole = blank(part.shape[1], extent, part)
        cells_of(whole, region).copy_(part)
        values.append(whole)
    return values[-1][0]


def blank(channels: int, extent: Region, like: Tensor) -> Float[Tensor, "1 channels height width"]:
    """Memory for a whole value, channels last; what is not written costs nothing on CPUs."""
    cells = torch.empty(extent.height, extent.width, channels, dtype=like.dtype, device=like.device)
    return cells.permute(2, 0, 1)[None]


def _extents(renderer: PreparedRenderer, size: tuple[int, int]) -> list[Region]:
    """All cells of every value."""
    whole = Region(0, 0, *size)
    found = [
        Region(0, 0, whole.height // stride, whole.width // stride)
        for stride in renderer.config.strides
    ]
    for step in renderer.steps:
        source = step.sources[0]
        own = found[source.index]
        found.append(own.doubled() if source.doubling else own)
    return found


def _read_by(region: Region, source: Source) -> Region:
    """Cells of a source that a region of it is read from, after its doubling."""
    if not source.doubling:
        return region
    return Region(
        region.top // 2 - 1,
        region.left // 2 - 1,
        (region.bottom - 1) // 2 + 2,
        (region.right - 1) // 2 + 2,
    )


def _with(region: Region | None, other: Region) -> Region:
    return other if region is None else region.joined(other)
