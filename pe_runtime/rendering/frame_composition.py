"""What some rays of a frame see: features for the ConvNet, or depth and shares."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from pe_runtime.rendering.frame_light import Lit, light
from pe_runtime.rendering.frame_passages import FramePassage
from pe_runtime.rendering.scene import RenderSettings


@dataclass(frozen=True)
class Level:
    """Rays of one feature map, and which channels of the fields it takes."""

    rays: slice
    channels: slice


@dataclass(frozen=True)
class Features:
    """What rays see.

    Attributes:
        levels: Per level (rays of the level among those composed, channels).
        evaluated: Samples whose features were evaluated.
    """

    levels: list[Float[Tensor, "_ _"]]
    evaluated: int


@dataclass(frozen=True)
class Measures:
    """Where rays end.

    Attributes:
        shares: Share of every object in every ray, in the order of the passages.
        depth: Weighted planar depth of everything but skies, metres: sum w t (not normalised).
    """

    shares: Float[Tensor, "rays objects"]
    depth: Float[Tensor, " rays"]


def compose_features(
    passages: Sequence[FramePassage],
    which: Int[Tensor, " rays"],
    levels: Sequence[Level],
    settings: RenderSettings,
) -> Features:
    """Features of some rays, sum w f over all samples of all objects.

    Args:
        passages: The objects' samples.
        which: The rays, in order.
        levels: Feature maps to draw.
        settings: Sampling and skipping.
    """
    parts = [_between(which, level.rays) for level in levels]
    drawn = [
        torch.zeros(part.stop - part.start, _count(level.channels), device=which.device)
        for part, level in zip(parts, levels, strict=True)
    ]
    evaluated = 0
    for lit in light(passages, which, settings):
        if lit.met.numel() == 0:
            continue
        kind = lit.passage.object.field.config.kind
        remember = settings.remember and kind != "playable"
        add = _add_surface if lit.passage.is_surface else _add_volume
        targets = list(zip(drawn, parts, levels, strict=True))
        evaluated += add(lit, targets, settings.weight_threshold, remember)
    return Features(drawn, evaluated)


def compose_measures(
    passages: Sequence[FramePassage], which: Int[Tensor, " rays"], settings: RenderSettings
) -> Measures:
    """Depth of some rays, and the share of every object in them; no features are evaluated."""
    shares = torch.zeros(which.shape[0], len(passages), device=which.device)
    depth = torch.zeros(which.shape[0], device=which.device)
    for column, lit in enumerate(light(passages, which, settings)):
        if lit.met.numel() == 0:
            continue
        shares[lit.met, column] = _sum_of_columns(lit.weight)
        if lit.passage.object.field.config.kind != "sky":
            depth[lit.met] += _sum_of_columns(lit.weight * lit.passage.depth[lit.row])
    return Measures(shares, depth)


_Target = tuple[Tensor, slice, Level]
"""A feature map, which of the composed rays it has, and its level."""


def _add_surface(lit: Lit, targets: Sequence[_Target], threshold: float, remember: bool) -> int:
    """Add what opaque surfaces show; how many samples were evaluated."""
    weight, evaluated = lit.weight[:, 0], 0
    some = weight > threshold
    met, row, weight = lit.met[some], lit.row[some], weight[some]
    for drawn, part, level in targets:
        own = _between(met, part)
        if own.stop > own.start:
            shown, count = lit.passage.shown(row[own], level.channels, remember)
            evaluated += count
            # No ray twice, so there is nothing to accumulate.
            drawn[met[own] - part.start] += shown * weight[own][:, None]
    return evaluated


def _add_volume(lit: Lit, targets: Sequence[_Target], threshold: float, remember: bool) -> int:
    """Add what the samples in a volume show together; how many of them were evaluated.

    The last linear layer comes after integration, once per ray.
    """
    ray, sample = torch.nonzero(lit.weight > threshold, as_tuple=True)
    branch, evaluated = lit.passage.branch(lit.passage.slot[lit.row[ray], sample], remember)
    carried = branch.mul_(lit.weight[ray, sample][:, None])
    integrated = torch.zeros(lit.row.shape[0], branch.shape[1], device=ray.device)
    integrated.index_add_(0, ray, carried)
    share = _sum_of_columns(lit.weight)
    for drawn, part, level in targets:
        own = _between(lit.met, part)
        if own.stop > own.start:
            field = lit.passage.object.field
            added = field.last_layer(integrated[own], share[own], level.channels)
            drawn[lit.met[own] - part.start] += added
    return evaluated


def _sum_of_columns(values: Float[Tensor, "rays samples"]) -> Float[Tensor, " rays"]:
    """Sum of each row, one column after the other: the same however many rows there are."""
    return torch.cumsum(values, dim=1)[:, -1]


def _count(channels: slice) -> int:
    return channels.stop - channels.start


def _between(ordered: Tensor, bounds: slice) -> slice:
    """Where the numbers within bounds lie among ordered ones."""
    edges = torch.searchsorted(ordered, ordered.new_tensor([bounds.start, bounds.stop]))
    first, last = edges.tolist()
    return slice(first, last)
