"""From feature maps to the picture, and again only where the maps have changed.

What a cell can reach grows by each convolution's radius and through each doubling; only that much
is computed again, step by step, from the values around it that are still right. On CPUs with oneDNN
(`PreparedRenderer.same_in_parts`) the result has the very bits of a picture that is decoded as a
whole, in float32 and bfloat16, with any number of threads; tried with the instructions of SSE4.1,
AVX, AVX2, AVX-512 and AVX-512 with bfloat16. Other backends may sum in another order for another
size, which stays within 1e-6 of the picture in float32.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from pe_runtime.rendering.gathering import Source, extent, gathered
from pe_runtime.rendering.prepared_renderer import PreparedRenderer, Step
from pe_runtime.rendering.regions import Region, changed_regions, merged

WHOLE = 0.8
"""From this share of a map on, all of it is computed."""
CALL = 15e6
"""One more region to compute takes as long as this many multiplications."""


@dataclass(frozen=True)
class Decoded:
    """What a picture was made of, for the next one.

    In float32 that is 40 MiB for a picture of 512x288 by the paper's decoder and 17 MiB for one of
    256x144 by the built-in model's; in bfloat16 about half.

    Attributes:
        values: Result of each step but the last.
        picture: Result of the last.
    """

    values: tuple[Float[Tensor, "1 _ _ _"], ...]
    picture: Float[Tensor, "1 3 height width"]

    @property
    def nbytes(self) -> int:
        """Bytes held."""
        return sum(each.nbytes for each in (*self.values, self.picture))


@torch.inference_mode()
def decode(
    renderer: PreparedRenderer, maps: Sequence[Float[Tensor, "1 _ _ _"]]
) -> tuple[Float[Tensor, "3 height width"], Decoded]:
    """Decode feature maps, finest first, into an sRGB picture in [0, 1].

    Args:
        renderer: From `prepared`.
        maps: One map per stride; each half as high and wide as the one before.
    """
    values = list(maps)
    for step in renderer.steps:
        values.append(value_of(step, values, extent_of(step, values), renderer.dtype))
    picture = values.pop()
    return picture[0], Decoded(tuple(values[len(maps) :]), picture)


@torch.inference_mode()
def decode_again(
    renderer: PreparedRenderer,
    maps: Sequence[Float[Tensor, "1 _ _ _"]],
    before: Decoded,
    changed: Sequence[Bool[Tensor, "_ _"]],
) -> tuple[Float[Tensor, "3 height width"], Decoded]:
    """Decode maps that differ only in some cells from those decoded before.

    Args:
        renderer: The one that decoded before.
        maps: All cells of the new maps. If they are of another size than those before, they are
            decoded as a whole.
        before: Of the maps before. Taken over: its values are written over, so it is of no use
            afterwards, least of all where this was interrupted; its picture stays as it was.
        changed: Per map, the cells that may differ.

    Returns:
        What `decode` returns; the very same objects as before where nothing changed.
    """
    if not _fits(before, renderer, maps):
        return decode(renderer, maps)
    regions = [changed_regions(each) for each in changed]
    if not any(regions):
        return before.picture[0], before
    values = [*maps, *before.values, before.picture]
    for index, step in enumerate(renderer.steps, start=len(maps)):
        whole = extent_of(step, values)
        reached = _reached(step, regions, whole)
        regions.append(reached)
        if index == len(values) - 1:
            values[index] = values[index].clone()
        for region in _work(step, reached, whole):
            part = value_of(step, values, region, renderer.dtype)
            if region == whole:
                values[index] = part
            else:
                cells_of(values[index], region).copy_(part)
    picture = values.pop()
    return picture[0], Decoded(tuple(values[len(maps) :]), picture)


def _fits(before: Decoded, renderer: PreparedRenderer, maps: Sequence[Tensor]) -> bool:
    stride = renderer.config.strides[0]
    return [n * stride for n in maps[0].shape[-2:]] == [*before.picture.shape[-2:]]


def extent_of(step: Step, values: Sequence[Tensor]) -> Region:
    """All cells of a step's value."""
    return extent(step.sources[0], values)


def cells_of(value: Tensor, region: Region) -> Tensor:
    """A region of a value, as it lies in memory."""
    return value[..., region.top : region.bottom, region.left : region.right]


def _reached(step: Step, regions: Sequence[Sequence[Region]], whole: Region) -> list[Region]:
    """Where a step's value may change if its sources change in their regions.

    What is added to it changes nowhere else: the sources come from the same cells and see further.
    """
    radius = step.convolution.radius if step.convolution else 0
    reached = []
    for source in step.sources:
        reached += [_seen_from(each, source).grown(radius, whole) for each in regions[source.index]]
    return merged(reached)


def _seen_from(region: Region, source: Source) -> Region:
    if not source.doubling:
        return region
    # Each of the four cells that stand in for one also has a share of its neighbour.
    fine = region.doubled()
    return Region(fine.top - 1, fine.left - 1, fine.bottom + 1, fine.right + 1)


def _work(step: Step, regions: Sequence[Region], whole: Region) -> list[Region]:
    """What to compute for that: regions with edges on the grid, or the whole."""
    products = step.convolution.products if step.convolution else 1000
    work = merged([each.aligned(whole) for each in regions], int(CALL / products))
    return [whole] if sum(each.area for each in work) >= WHOLE * whole.area else work


def value_of(step: Step, values: Sequence[Tensor], region: Region, dtype: torch.dtype) -> Tensor:
    """A step's result in a region.

    Args:
        step: The step.
        values: Maps and results of the steps before, each whole (1, channels, height, width); only
            what the region is made of is read.
        region: Cells of the result.
        dtype: In which convolutions are computed.
    """
    convolution = step.convolution
    if convolution is None:
        out = gathered(step.sources, values, region, 0, 0, torch.float32)
        return _squashed(out) if step.after == "sigmoid" else out
    spare = convolution.spare(region.width)
    padded = gathered(step.sources, values, region, convolution.radius, spare, dtype)
    out = convolution(padded, region.width)
    if step.after == "sigmoid":
        out = out.float()
    if step.plus is not None:
        out.add_(cells_of(values[step.plus][:, : convolution.channels], region))
    if step.after == "sigmoid":
        return _squashed(out)
    return out.relu_() if step.after == "relu" else out


def _squashed(logits: Tensor) -> Tensor:
    # torch's sigmoid has other last bits at the end of a row of numbers than elsewhere.
    return logits.neg().exp_().add_(1).reciprocal_()
