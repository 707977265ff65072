"""How much of a pixel's light each sample of a frame gives: all objects composed along their rays.

A ray gets the same numbers whichever rays are composed with it, so a frame can be drawn whole, in
parts, or only where something changed. Behind an opaque surface nothing can be seen, so of all
surfaces on a ray only the first takes part; rays that meet nothing else are not composed at all.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from pe_runtime.rendering.compositing import OPAQUE, composite
from pe_runtime.rendering.frame_passages import FramePassage
from pe_runtime.rendering.passages import SKY_DEPTH
from pe_runtime.rendering.release_2022 import carve, thickness_to_next
from pe_runtime.rendering.scene import RenderSettings

VECTOR = 64
"""Rows come in multiples of so many: whole vectors, whatever the number of columns."""


@dataclass(frozen=True)
class Lit:
    """One object's samples on those of the composed rays that can see it.

    Attributes:
        passage: The object's samples.
        met: Which of the composed rays, in order.
        row: Their rows in the passage.
        weight: Share of each sample in its ray (paper, eq. 1).
    """

    passage: FramePassage
    met: Int[Tensor, " seen"]
    row: Int[Tensor, " seen"]
    weight: Float[Tensor, "seen samples"]


@dataclass(frozen=True)
class _Front:
    """The first opaque surface on each ray.

    Attributes:
        owner: Whose it is, as a place in a list of surfaces; -1 where there is none.
        depth: Where it is.
    """

    owner: Int[Tensor, " rays"]
    depth: Float[Tensor, " rays"]


def light(
    passages: Sequence[FramePassage], which: Int[Tensor, " rays"], settings: RenderSettings
) -> list[Lit]:
    """Compose all objects along some rays (paper, eq. 1, for all objects together).

    Args:
        passages: The objects' samples.
        which: The rays, in order.
        settings: Sampling.

    Returns:
        One for each passage, in their order.
    """
    if settings.release is not None:
        # Even the samples of objects that a ray misses end what stands before them.
        weights = _weights(passages, which, None, settings)
        return [_lit(*each, which) for each in zip(passages, weights, strict=True)]
    surfaces = [each for each in passages if each.is_surface]
    volumes = [each for each in passages if not each.is_surface and each.rays.numel()]
    front = _front(surfaces, which)
    busy = torch.zeros(which.shape[0], dtype=torch.bool, device=which.device)
    for each in volumes:
        busy |= each.row_of[which] >= 0
    among = torch.nonzero(busy)[:, 0]
    nearest = _Front(front.owner[among], front.depth[among])
    weights = _weights(volumes, which[among], nearest, settings)
    left = torch.ones(which.shape[0], device=which.device)
    left[among] = weights.pop()[:, 0]
    found = {}
    for each, weight in zip(volumes, weights, strict=True):
        own = _lit(each, weight, which[among])
        found[id(each)] = Lit(each, among[own.met], own.row, own.weight)
    for number, each in enumerate(surfaces):
        met = torch.nonzero(front.owner == number)[:, 0]
        found[id(each)] = Lit(each, met, each.row_of[which[met]], left[met][:, None])
    return [found.get(id(each)) or _unseen(each) for each in passages]


def _front(surfaces: Sequence[FramePassage], which: Tensor) -> _Front:
    """Of surfaces at equal depths the first in the list counts."""
    owner = torch.full_like(which, -1)
    depth = torch.full(which.shape, 2 * SKY_DEPTH, device=which.device)
    for number, each in enumerate(surfaces):
        if each.rays.numel() == 0:
            continue
        row = each.row_of[which]
        own = each.depth[row.clamp(min=0), 0]
        closer = (row >= 0) & (own < depth)
        owner.masked_fill_(closer, number)
        depth = torch.where(closer, own, depth)
    return _Front(owner, depth)


def _lit(passage: FramePassage, weight: Tensor | None, which: Tensor) -> Lit:
    """The rays that meet an object, out of its weights on all rays."""
    if weight is None:
        return _unseen(passage)
    row = passage.row_of[which]
    met = torch.nonzero(row >= 0)[:, 0]
    return Lit(passage, met, row[met], weight[met])


def _unseen(passage: FramePassage) -> Lit:
    none = passage.rays[:0]
    return Lit(passage, none, none, passage.depth[:0])


def _weights(
    passages: Sequence[FramePassage],
    which: Tensor,
    front: _Front | None,
    settings: RenderSettings,
) -> list[Tensor | None]:
    """Weights of all samples on the rays; None for objects that no ray meets at all.

    Those of the first surfaces come last, if they are given.
    """
    count, which = which.shape[0], _filled(which)
    depths, thicknesses, columns, start = [], [], [], 0
    if front is not None:
        depths.append(_filled(front.depth)[:, None])
        thicknesses.append(torch.where(_filled(front.owner) >= 0, OPAQUE, 0.0)[:, None])
        start = 1
    for each in passages:
        depth, thickness = _table(each, which)
        depths.append(depth)
        thicknesses.append(thickness)
        columns.append(slice(start, start + depth.shape[1]))
        start += depth.shape[1]
    if not depths:
        return []
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
    met = [each.rays.numel() > 0 for each in passages]
    found = [weights[:count, c] if hit else None for c, hit in zip(columns, met, strict=True)]
    return found if front is None else [*found, weights[:count, :1]]


def _table(each: FramePassage, which: Tensor) -> tuple[Tensor, Tensor]:
    """Depths and thicknesses of an object's samples on rays; empty space where it is missed."""
    if each.rays.numel() == 0:
        depth = torch.full((which.shape[0], 1), each.elsewhere, device=which.device)
        return depth, torch.zeros_like(depth)
    row = each.row_of[which]
    away, safe = (row < 0)[:, None], row.clamp(min=0)
    depth = each.depth[safe].masked_fill_(away, each.elsewhere)
    return depth, each.thickness[safe].masked_fill_(away, 0.0)


def _filled(values: Tensor) -> Tensor:
    """Values of rays, the last one's repeated up to whole vectors of the processor.

    Exponentials of what is left over after whole vectors are computed by other instructions, which
    round differently.
    """
    return torch.cat([values, values[-1:].expand(-values.shape[0] % VECTOR)])
