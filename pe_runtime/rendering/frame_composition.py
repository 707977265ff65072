"""All objects of one frame along some of its rays: weights, features, depth, shares.

A ray gets the same numbers whichever rays are composed with it, so a frame can be drawn whole, in
parts, or only where something changed.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from pe_runtime.rendering.compositing import composite
from pe_runtime.rendering.frame_passages import FramePassage
from pe_runtime.rendering.release_2022 import carve, thickness_to_next
from pe_runtime.rendering.scene import RenderSettings

VECTOR = 64
"""Rows come in multiples of so many: whole vectors, whatever the number of columns."""


@dataclass(frozen=True)
class Level:
    """Rays of one feature map, and which channels of the fields it takes."""

    rays: slice
    channels: slice


@dataclass(frozen=True)
class Seen:
    """What some rays see.

    Attributes:
        features: Per level (rays of the level among those composed, channels).
        shares: Share of every object in every ray, in the order of the passages.
        depth: Weighted planar depth of everything but skies, metres: sum w t (not normalised).
        feature_samples: Samples whose features were evaluated.
    """

    features: list[Float[Tensor, "_ _"]]
    shares: Float[Tensor, "rays objects"]
    depth: Float[Tensor, " rays"]
    feature_samples: int


def compose_rays(
    passages: Sequence[FramePassage],
    which: Int[Tensor, " rays"],
    levels: Sequence[Level],
    settings: RenderSettings,
) -> Seen:
    """Compose all objects along some rays (paper, eq. 1, for all objects together).

    Args:
        passages: The objects' samples.
        which: The rays, in order.
        levels: Feature maps to draw; empty for depth and shares only.
        settings: Sampling and skipping.
    """
    surfaces = [i for i, each in enumerate(passages) if each.depth.shape[1] == 1]
    if settings.release is not None or len(surfaces) in (0, len(passages)):
        return _composed(passages, which, levels, settings)
    # Most rays meet surfaces only: their tables are narrow.
    busy = torch.zeros(which.shape[0], dtype=torch.bool, device=which.device)
    for index, each in enumerate(passages):
        if index not in surfaces:
            busy |= each.row_of[which] >= 0
    both = _composed(passages, which[busy], levels, settings)
    plain = _composed([passages[i] for i in surfaces], which[~busy], levels, settings)
    return _joined(both, plain, busy, surfaces, _parts(which, levels))


def _joined(
    both: Seen, plain: Seen, busy: Tensor, surfaces: Sequence[int], parts: Sequence[slice]
) -> Seen:
    """What all rays see, from those that meet volumes and those that meet surfaces only."""
    shares = both.shares.new_zeros(busy.shape[0], both.shares.shape[1])
    depth = both.depth.new_empty(busy.shape[0])
    shares[busy], depth[busy], depth[~busy] = both.shares, both.depth, plain.depth
    narrow = shares.new_zeros(plain.shares.shape[0], shares.shape[1])
    narrow[:, list(surfaces)] = plain.shares
    shares[~busy] = narrow
    features = []
    for part, first, second in zip(parts, both.features, plain.features, strict=True):
        whole = first.new_empty(part.stop - part.start, first.shape[1])
        whole[busy[part]], whole[~busy[part]] = first, second
        features.append(whole)
    return Seen(features, shares, depth, both.feature_samples + plain.feature_samples)


def _composed(
    passages: Sequence[FramePassage],
    which: Int[Tensor, " rays"],
    levels: Sequence[Level],
    settings: RenderSettings,
) -> Seen:
    """What rays see that may meet all these objects."""
    rows = [each.row_of[which] for each in passages]
    weights = _weights(passages, which, settings)
    shares = which.new_zeros(which.shape[0], len(passages), dtype=torch.float32)
    depth = torch.zeros(which.shape[0], device=which.device)
    parts = _parts(which, levels)
    features = [
        torch.zeros(part.stop - part.start, _count(level.channels), device=which.device)
        for part, level in zip(parts, levels, strict=True)
    ]
    evaluated = 0
    for column, (each, row, weight) in enumerate(zip(passages, rows, weights, strict=True)):
        if weight is None:
            continue
        met = torch.nonzero(row >= 0)[:, 0]
        row, weight = row[met], weight[met]
        share = _sum_of_columns(weight)
        shares[met, column] = share
        if each.object.field.config.kind != "sky":
            depth[met] += _sum_of_columns(weight * each.depth[row])
        if not levels:
            continue
        integrated, count = _integrated(each, row, weight, settings)
        evaluated += count
        for part, level, drawn in zip(parts, levels, features, strict=True):
            own = _between(met, part)
            if own.stop > own.start:
                added = each.object.field.last_layer(integrated[own], share[own], level.channels)
                drawn.index_add_(0, met[own] - part.start, added)
    return Seen(features, shares, depth, evaluated)


def _sum_of_columns(values: Float[Tensor, "rays samples"]) -> Float[Tensor, " rays"]:
    """Sum of each row, one column after the other: the same however many rows there are."""
    return torch.cumsum(values, dim=1)[:, -1]


def _count(channels: slice) -> int:
    return channels.stop - channels.start


def _parts(which: Tensor, levels: Sequence[Level]) -> list[slice]:
    """Where the rays of each level lie among those composed."""
    return [_between(which, level.rays) for level in levels]


def _between(ordered: Tensor, bounds: slice) -> slice:
    edges = torch.searchsorted(ordered, ordered.new_tensor([bounds.start, bounds.stop]))
    first, last = edges.tolist()
    return slice(first, last)


def _weights(
    passages: Sequence[FramePassage], which: Tensor, settings: RenderSettings
) -> list[Tensor | None]:
    """Weights of every passage's samples on the rays; None where no ray meets the object."""
    count, which = which.shape[0], _filled(which)
    rows = [each.row_of[which] for each in passages]
    depths, thicknesses, columns, start = [], [], [], 0
    for each, row in zip(passages, rows, strict=True):
        samples = each.depth.shape[1]
        if each.depth.shape[0] == 0:
            if settings.release is None:
                columns.append(None)
                continue
            depth = torch.full((which.shape[0], 1), each.elsewhere, device=which.device)
            thickness, samples = torch.zeros_like(depth), 1
        else:
            away, safe = (row < 0)[:, None], row.clamp(min=0)
            depth = each.depth[safe].masked_fill_(away, each.elsewhere)
            thickness = each.thickness[safe].masked_fill_(away, 0.0)
        depths.append(depth)
        thicknesses.append(thickness)
        columns.append(slice(start, start + samples))
        start += samples
    if not depths:
        return [None] * len(passages)
    depth, thickness = torch.cat(depths, dim=1), torch.cat(thicknesses, dim=1)
    if settings.release is None:
        weights = composite(depth, thickness)
    else:
        if settings.release.carve:
            kinds = [each.object.field.config.kind for each in passages]
            fixed = [c for c, kind in zip(columns, kinds, strict=True) if kind != "playable"]
            moving = [c for c, kind in zip(columns, kinds, strict=True) if kind == "playable"]
            depth, thickness = carve(depth, thickness, fixed, moving)
        weights = composite(depth, thickness, thickness_to_next)
    met = [each.depth.shape[0] > 0 for each in passages]
    return [
        weights[:count, c] if c is not None and hit else None
        for c, hit in zip(columns, met, strict=True)
    ]


def _filled(which: Tensor) -> Tensor:
    """Rays, the last one repeated up to whole vectors of the processor.

    Exponentials of what is left over after whole vectors are computed by other instructions, which
    round differently.
    """
    return torch.cat([which, which[-1:].expand(-which.shape[0] % VECTOR)])


def _integrated(
    each: FramePassage, row: Tensor, weight: Tensor, settings: RenderSettings
) -> tuple[Float[Tensor, "rays head"], int]:
    """Weighted sum of branch features along the rays, and how many samples were evaluated."""
    ray, sample = torch.nonzero(weight > settings.weight_threshold, as_tuple=True)
    slots = each.slot[row[ray], sample]
    if settings.remember and each.object.field.config.kind != "playable":
        branch, count = each.remembered(slots)
    else:
        branch, count = each.branch(slots), slots.shape[0]
    carried = branch * weight[ray, sample][:, None]
    whole = torch.zeros(row.shape[0], branch.shape[1], device=row.device)
    return whole.index_add_(0, ray, carried), count
