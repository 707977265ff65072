"""Rays -> features: all objects of a scene composed along every ray.

The order of work is what makes it cheap: densities first, for the rays that pass through an
object's volume; then the weights of all objects together; then features, only for samples that
still carry weight; then one linear layer per ray.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from pe_runtime.field.object_field import ObjectField
from pe_runtime.geometry.boxes import intersect_box
from pe_runtime.rendering.compositing import OPAQUE, composite
from pe_runtime.rendering.sampling import sample_intervals

SKY_DEPTH = 1e9
"""Planar depth of a sky in metres: behind everything, and finite so that products stay finite."""


@dataclass(frozen=True)
class Rays:
    """Rays of several frames.

    Attributes:
        centres: Camera centre of each frame, metres; float64 so that far-away cameras stay exact.
        directions: World directions per metre of planar depth; float64.
        frame: Frame of each ray.
    """

    centres: Float[Tensor, "frames 3"]
    directions: Float[Tensor, "rays 3"]
    frame: Int[Tensor, " rays"]


@dataclass(frozen=True)
class SceneObject:
    """One object as the renderer sees it, in every frame of a batch.

    `heading` turns it about the world's z axis, in radians; None keeps the world's axes.
    """

    field: ObjectField
    position: Float[Tensor, "frames 3"]
    style: Float[Tensor, "frames style"]
    pose: Float[Tensor, "frames pose"]
    visible: Bool[Tensor, " frames"]
    heading: Float[Tensor, " frames"] | None = None


@dataclass(frozen=True)
class RenderSettings:
    """How rays are sampled and what is left out.

    Attributes:
        near: Planar depth before which nothing is drawn, metres.
        jitter: Draw samples at random places of their intervals (training).
        density_noise: Standard deviation of noise on raw densities (training).
        weight_threshold: Samples of no more weight than this get no features; 0 is exact.
        sample_share: Share of each class's samples that is drawn.
        bucket: Row counts are padded to multiples of this, so that kernels are not re-tuned.
    """

    near: float = 0.05
    jitter: bool = False
    density_noise: float = 0.0
    weight_threshold: float = 0.0
    sample_share: float = 1.0
    bucket: int = 256


@dataclass(frozen=True)
class _Passage:
    """The samples of one object on the rays that pass through it (padded to a full bucket)."""

    rays: Int[Tensor, " hits"]
    frame: Int[Tensor, " hits"]
    depth: Float[Tensor, "hits samples"]
    coordinates: Float[Tensor, "hits samples 3"]
    thickness: Float[Tensor, "hits samples"]
    hidden: Float[Tensor, "hits samples width"] | None


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
    rays = _with_dummy(rays)
    passages = [_pass_through(rays, each, settings) for each in objects]
    weights = _weigh(passages, count, rays.directions.device)
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


def _length(part: slice, whole: int) -> int:
    return (whole if part.stop is None else part.stop) - (part.start or 0)


def _with_dummy(rays: Rays) -> Rays:
    """Append one ray that pads buckets; nothing that happens to it is looked at."""
    ahead = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64, device=rays.directions.device)
    directions = torch.cat([rays.directions.double(), ahead])
    return Rays(rays.centres, directions, torch.cat([rays.frame, rays.frame.new_zeros(1)]))


def _pass_through(rays: Rays, each: SceneObject, settings: RenderSettings) -> _Passage:
    """Sample one object: rays that meet its volume, sample places, optical thickness."""
    if each.field.config.kind == "sky":
        return _sky(rays, each)
    config, field = each.field.config, each.field
    # Subtract in float64: far from the world's origin the difference is what has the digits.
    origins = (rays.centres - each.position.double())[rays.frame]
    low, high = origins.new_tensor(config.low), origins.new_tensor(config.high)
    near, far, hit = intersect_box(origins, rays.directions, low, high, settings.near)
    hit = hit & each.visible[rays.frame]
    hit[-1] = False
    index = _padded(torch.nonzero(hit)[:, 0], settings.bucket, hit.shape[0] - 1)
    count = 1 if config.opaque else max(1, round(config.samples * settings.sample_share))
    places = None
    if config.opaque:
        # Nothing behind the surface can be seen: the one sample is where the ray enters.
        places = torch.zeros(index.shape[0], 1, device=index.device, dtype=torch.float64)
    elif settings.jitter:
        places = torch.rand(index.shape[0], count, device=index.device, dtype=torch.float64)
    depth, step = sample_intervals(near[index], far[index], count, places)
    points = origins[index][:, None] + depth[..., None] * rays.directions[index][:, None]
    coordinates = field.coordinates(points).float().clamp(-1.0, 1.0)
    frame = rays.frame[index]
    if config.opaque:
        thickness = torch.where(index < hit.shape[0] - 1, OPAQUE, 0.0).float()
        thickness = thickness[:, None].expand(-1, count)
        return _Passage(index, frame, depth.float(), coordinates, thickness, None)
    hidden = field.trunk(coordinates, frame, each.pose)
    length = (step * rays.directions[index].norm(dim=-1)).float()
    thickness = field.densities(hidden, settings.density_noise) * length[:, None]
    return _Passage(index, frame, depth.float(), coordinates, thickness, hidden)


def _sky(rays: Rays, each: SceneObject) -> _Passage:
    """A sky fills every ray behind everything else; V is asked for the ray's direction."""
    index = torch.nonzero(each.visible[rays.frame[:-1]])[:, 0]
    directions = rays.directions[index]
    unit = (directions / directions.norm(dim=-1, keepdim=True)).float()[:, None]
    depth = torch.full_like(unit[..., 0], SKY_DEPTH)
    thickness = torch.full_like(depth, OPAQUE)
    return _Passage(index, rays.frame[index], depth, unit, thickness, None)


def _padded(index: Tensor, bucket: int, dummy: int) -> Tensor:
    return torch.nn.functional.pad(index, (0, -index.shape[0] % bucket), value=dummy)


def _weigh(passages: Sequence[_Passage], count: int, device: torch.device) -> list[Tensor]:
    """Weights of every passage's samples, composed over all objects."""
    total = sum(p.depth.shape[1] for p in passages)
    depth = torch.full((count + 1, total), 2 * SKY_DEPTH, device=device)
    thickness = torch.zeros(count + 1, total, device=device)
    start, columns = 0, []
    for p in passages:
        columns.append(torch.arange(start, start + p.depth.shape[1], device=device))
        cells = (p.rays[:, None], columns[-1])
        depth = depth.index_put(cells, p.depth)
        thickness = thickness.index_put(cells, p.thickness)
        start += p.depth.shape[1]
    weights = composite(depth, thickness)
    return [weights[p.rays][:, c] for p, c in zip(passages, columns, strict=True)]


def _share(passage: _Passage, weights: Tensor, count: int) -> Float[Tensor, " rays"]:
    """Summed weight of one object on every ray."""
    whole = torch.zeros(count + 1, device=weights.device)
    return whole.index_add(0, passage.rays, weights.sum(dim=-1))[:-1]


def _integrate(
    each: SceneObject, passage: _Passage, weights: Tensor, count: int, settings: RenderSettings
) -> tuple[Float[Tensor, "rays head"], int]:
    """Weighted sum of branch features along every ray, and how many samples were evaluated."""
    if torch.is_grad_enabled() and passage.hidden is not None:
        branch = each.field.branch(passage.hidden, passage.frame, each.style)
        summed = torch.einsum("rs,rsh->rh", weights, branch.float())
        whole = summed.new_zeros(count + 1, summed.shape[1])
        return whole.index_add(0, passage.rays, summed)[:-1], weights.numel()
    row, column = torch.nonzero(weights.detach() > settings.weight_threshold, as_tuple=True)
    kept = row.shape[0]
    row = _padded(row, settings.bucket, 0)
    column = _padded(column, settings.bucket, 0)
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
    passages: Sequence[_Passage],
    weights: Sequence[Tensor],
    count: int,
    device: torch.device,
) -> Float[Tensor, " rays"]:
    depth = torch.zeros(count + 1, device=device)
    for each, passage, w in zip(objects, passages, weights, strict=True):
        if each.field.config.kind != "sky":
            depth = depth.index_add(0, passage.rays, (w * passage.depth).sum(dim=-1))
    return depth[:-1]
