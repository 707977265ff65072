"""Rays -> features: all objects of a scene composed along every ray.

The order of work is what makes it cheap: densities first, for the rays that pass through an
object's volume; then the weights of all objects together; then features, only for samples that
still carry weight; then one linear layer per ray.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from pe_runtime.rendering.compositing import composite
from pe_runtime.rendering.passages import Passage, padded, pass_through, with_dummy
from pe_runtime.rendering.release_2022 import carve, thickness_to_next
from pe_runtime.rendering.scene import Rays, RenderSettings, SceneObject


@dataclass(frozen=True)
class Composition:
    """What the rays see.

    Attributes:
        features: One tensor (rays of the group, channels) per group of rays.
        weights: Share of every object in every ray, in the order of the objects.
        depth: Weighted planar depth of everything but skies, metres: sum w t (not normalised).
        solid: Summed weight of everything but skies.
        statistics: Counters: rays, hits, samples, feature_samples.
    """

    features: list[Float[Tensor, "_ _"]]
    weights: Float[Tensor, "rays objects"]
    depth: Float[Tensor, " rays"]
    solid: Float[Tensor, " rays"]
    statistics: dict[str, int]


def compose(
    rays: Rays,
    objects: Sequence[SceneObject],
    groups: Sequence[tuple[slice, slice]],
    settings: RenderSettings,
) -> Composition:
    """Render features along rays (paper, eq. 1, for all objects together).

    Args:
        rays: The rays.
        objects: The scene.
        groups: For each group of rays, which rays and which feature channels; empty for a pass
            that needs no features (depth, masks).
        settings: Sampling and skipping.

    Returns:
        Features of each group, and depth and object weights of all rays.
    """
    count = rays.directions.shape[0]
    rays = with_dummy(rays)
    passages = [pass_through(rays, each, settings) for each in objects]
    weights = _weigh(passages, objects, count, settings)
    shares = [_share(passage, w, count) for passage, w in zip(passages, weights, strict=True)]
    device = rays.directions.device
    features = [torch.zeros(1, device=device) for _ in groups]
    statistics = {"rays": count, "hits": 0, "samples": 0, "feature_samples": 0}
    for each, passage, w, share in zip(objects, passages, weights, shares, strict=True):
        statistics["hits"] += passage.rays.shape[0]
        statistics["samples"] += passage.depth.numel()
        if not groups or passage.rays.shape[0] == 0:
            continue
        integrated, evaluated = _integrate(each, passage, w, count, settings)
        statistics["feature_samples"] += evaluated
        for index, (which, channels) in enumerate(groups):
            drawn = each.field.features(integrated[which], share[which], channels)
            features[index] = features[index] + drawn
    solid = [s for s, each in zip(shares, objects, strict=True) if each.field.config.kind != "sky"]
    features = [
        each.expand(_length(which, count), _length(channels, 0)) if each.ndim == 1 else each
        for each, (which, channels) in zip(features, groups, strict=True)
    ]
    return Composition(
        features,
        torch.stack(shares, dim=-1) if shares else torch.zeros(count, 0, device=device),
        _depth(objects, passages, weights, count, device),
        torch.stack(solid).sum(dim=0) if solid else torch.zeros(count, device=device),
        statistics,
    )


def join(parts: Sequence[Composition]) -> Composition:
    """What several bundles of rays with the same groups see, one after the other."""
    first = parts[0]
    return Composition(
        [torch.cat([p.features[i] for p in parts]) for i in range(len(first.features))],
        torch.cat([p.weights for p in parts]),
        torch.cat([p.depth for p in parts]),
        torch.cat([p.solid for p in parts]),
        {key: sum(p.statistics[key] for p in parts) for key in first.statistics},
    )


def _length(part: slice, whole: int) -> int:
    return (whole if part.stop is None else part.stop) - (part.start or 0)


def _weigh(
    passages: Sequence[Passage],
    objects: Sequence[SceneObject],
    count: int,
    settings: RenderSettings,
) -> list[Tensor]:
    """Weights of every passage's samples, composed over all objects."""
    depth, thickness, columns = _table(passages, count)
    if settings.release is None:
        weights = composite(depth, thickness)
    else:
        kinds = [each.field.config.kind for each in objects]
        if settings.release.carve:
            fixed = [c for c, kind in zip(columns, kinds, strict=True) if kind != "playable"]
            moving = [c for c, kind in zip(columns, kinds, strict=True) if kind == "playable"]
            depth, thickness = carve(depth, thickness, fixed, moving)
        weights = composite(depth, thickness, thickness_to_next)
    return [weights[p.rays, c] for p, c in zip(passages, columns, strict=True)]


def _table(passages: Sequence[Passage], count: int) -> tuple[Tensor, Tensor, list[slice]]:
    """Depths and thicknesses of all samples, ray by ray, and the columns of each passage."""
    depths, thicknesses, columns, start = [], [], [], 0
    for p in passages:
        columns.append(slice(start, start + p.depth.shape[1]))
        start = columns[-1].stop
        whole = p.depth.new_full((count + 1, p.depth.shape[1]), p.elsewhere)
        depths.append(whole.index_copy(0, p.rays, p.depth))
        whole = p.thickness.new_zeros(count + 1, p.depth.shape[1])
        thicknesses.append(whole.index_copy(0, p.rays, p.thickness))
    if not passages:
        return torch.zeros(count + 1, 0), torch.zeros(count + 1, 0), columns
    return torch.cat(depths, dim=1), torch.cat(thicknesses, dim=1), columns


def _share(passage: Passage, weights: Tensor, count: int) -> Float[Tensor, " rays"]:
    """Summed weight of one object on every ray."""
    whole = torch.zeros(count + 1, device=weights.device)
    return whole.index_add(0, passage.rays, weights.sum(dim=-1))[:-1]


def _integrate(
    each: SceneObject, passage: Passage, weights: Tensor, count: int, settings: RenderSettings
) -> tuple[Float[Tensor, "rays head"], int]:
    """Weighted sum of branch features along every ray, and how many samples were evaluated."""
    if torch.is_grad_enabled() and passage.hidden is not None:
        branch = each.field.branch(passage.hidden, passage.frame, each.style)
        summed = torch.einsum("rs,rsh->rh", weights, branch.float())
        whole = summed.new_zeros(count + 1, summed.shape[1])
        return whole.index_add(0, passage.rays, summed)[:-1], weights.numel()
    row, column = torch.nonzero(weights.detach() > settings.weight_threshold, as_tuple=True)
    kept = row.shape[0]
    row = padded(row, settings.bucket, 0)
    column = padded(column, settings.bucket, 0)
    frame = passage.frame[row]
    if passage.hidden is None:
        hidden = each.field.trunk(passage.coordinates[row, column][:, None], frame, each.pose)
    else:
        hidden = passage.hidden[row, column][:, None]
    branch = each.field.branch(hidden, frame, each.style)[:, 0].float()
    carried = weights[row, column] * (torch.arange(row.shape[0], device=row.device) < kept)
    whole = branch.new_zeros(count + 1, branch.shape[1])
    return whole.index_add(0, passage.rays[row], carried[:, None] * branch)[:-1], kept


def _depth(
    objects: Sequence[SceneObject],
    passages: Sequence[Passage],
    weights: Sequence[Tensor],
    count: int,
    device: torch.device,
) -> Float[Tensor, " rays"]:
    depth = torch.zeros(count + 1, device=device)
    for each, passage, w in zip(objects, passages, weights, strict=True):
        if each.field.config.kind != "sky":
            depth = depth.index_add(0, passage.rays, (w * passage.depth).sum(dim=-1))
    return depth[:-1]
