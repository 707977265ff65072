"""One object on the rays that pass through it: where it is sampled, and how dense it is there."""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from pe_runtime.config import ObjectClassConfig
from pe_runtime.geometry.boxes import intersect_box
from pe_runtime.rendering.compositing import OPAQUE
from pe_runtime.rendering.release_2022 import SKY_DENSITY, place_samples, within
from pe_runtime.rendering.sampling import sample_intervals
from pe_runtime.rendering.scene import Rays, RenderSettings, SceneObject

SKY_DEPTH = 1e30
"""Planar depth of a sky in metres: behind everything, and finite so that products stay finite."""


@dataclass(frozen=True)
class Passage:
    """The samples of one object on the rays that pass through it (padded to a full bucket).

    Attributes:
        rays: Which rays; padding names the dummy ray.
        frame: Their frames.
        depth: Planar depths, nearest first.
        coordinates: Where the field is asked.
        thickness: Optical thickness; under "release-2022" per metre of planar depth.
        hidden: The field's trunk at the samples, where it was needed for the density.
        elsewhere: Planar depth of the object's samples on all other rays (empty space).
    """

    rays: Int[Tensor, " hits"]
    frame: Int[Tensor, " hits"]
    depth: Float[Tensor, "hits samples"]
    coordinates: Float[Tensor, "hits samples coordinates"]
    thickness: Float[Tensor, "hits samples"]
    hidden: Float[Tensor, "hits samples width"] | None
    elsewhere: float = 2 * SKY_DEPTH


@dataclass(frozen=True)
class _Chord:
    """Straight line of each ray through a volume, in the object's frame.

    In float64, but for the "release-2022" quadrature, which is float32 from here on.
    """

    origins: Float[Tensor, "rays 3"]
    directions: Float[Tensor, "rays 3"]
    near: Float[Tensor, " rays"]
    far: Float[Tensor, " rays"]
    hit: Bool[Tensor, " rays"]


def with_dummy(rays: Rays) -> Rays:
    """Append one ray that pads buckets; nothing that happens to it is looked at."""
    ahead = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64, device=rays.directions.device)
    directions = torch.cat([rays.directions.double(), ahead])
    return Rays(rays.centres, directions, torch.cat([rays.frame, rays.frame.new_zeros(1)]))


def padded(index: Int[Tensor, " rows"], bucket: int, dummy: int) -> Int[Tensor, " padded"]:
    """Indices, padded with a dummy to a multiple of the bucket."""
    return torch.nn.functional.pad(index, (0, -index.shape[0] % bucket), value=dummy)


def pass_through(rays: Rays, each: SceneObject, settings: RenderSettings) -> Passage:
    """Sample one object: rays that meet its volume, sample places, optical thickness.

    Args:
        rays: The rays, the last of them the dummy.
        each: The object.
        settings: Sampling.
    """
    config = each.field.config
    if config.kind == "sky":
        return _sky(rays, each, settings)
    chord = _chord(rays, each, settings)
    index = padded(torch.nonzero(chord.hit)[:, 0], settings.bucket, rays.frame.shape[0] - 1)
    count = 1 if config.opaque else max(1, round(config.samples * settings.sample_share))
    if settings.release is not None:
        return _as_released(rays, each, chord, index, count, settings)
    places = None
    if config.opaque:
        # Nothing behind the surface can be seen: the one sample is where the ray enters.
        places = torch.zeros(index.shape[0], 1, device=index.device, dtype=torch.float64)
    elif settings.jitter:
        places = torch.rand(index.shape[0], count, device=index.device, dtype=torch.float64)
    depth, step = sample_intervals(chord.near[index], chord.far[index], count, places)
    coordinates = each.field.coordinates(_points(chord, index, depth)).float().clamp(-1.0, 1.0)
    frame = rays.frame[index]
    if config.opaque:
        thickness = torch.where(index < rays.frame.shape[0] - 1, OPAQUE, 0.0).float()
        thickness = thickness[:, None].expand(-1, count)
        return Passage(index, frame, depth.float(), coordinates, thickness, None)
    hidden = each.field.trunk(coordinates, frame, each.pose)
    length = (step * chord.directions[index].norm(dim=-1)).float()
    thickness = each.field.densities(hidden, settings.density_noise) * length[:, None]
    return Passage(index, frame, depth.float(), coordinates, thickness, hidden)


def _chord(rays: Rays, each: SceneObject, settings: RenderSettings) -> _Chord:
    config = each.field.config
    # Subtract in float64: far from the world's origin the difference is what has the digits.
    origins = (rays.centres - each.position.double())[rays.frame]
    directions = rays.directions
    if each.heading is not None:
        object_from_world = turn(-each.heading.double())[rays.frame]
        origins = torch.einsum("rij,rj->ri", object_from_world, origins)
        directions = torch.einsum("rij,rj->ri", object_from_world, directions)
    if settings.release is not None:
        origins, directions = origins.float(), directions.float()
    low, high = origins.new_tensor(config.low), origins.new_tensor(config.high)
    near, far, hit = meet(origins, directions, (low, high), config, settings)
    hit = hit & each.visible[rays.frame]
    hit[-1] = False
    return _Chord(origins, directions, near, far, hit)


def meet(
    origins: Tensor,
    directions: Tensor,
    box: tuple[Tensor, Tensor],
    config: ObjectClassConfig,
    settings: RenderSettings,
) -> tuple[Tensor, Tensor, Tensor]:
    """Where rays enter and leave a volume, and whether they meet it, in the model's quadrature.

    Args:
        origins: (rays, 3) in the object's frame, metres.
        directions: (rays, 3).
        box: Its two corners.
        config: Its class.
        settings: Near depth and quadrature.
    """
    if settings.release is None:
        return intersect_box(origins, directions, *box, settings.near)
    offset = origins.new_tensor(settings.release.offset)
    near, far, hit = intersect_box(origins, directions, *box, -torch.inf, offset)
    first, last = depth_range(config, settings)
    # A passage that ends before the range has all its samples at its near end, outside.
    return near.clamp(first, last), far.clamp(first, last), hit & (far >= first)


def _as_released(
    rays: Rays,
    each: SceneObject,
    chord: _Chord,
    index: Int[Tensor, " hits"],
    count: int,
    settings: RenderSettings,
) -> Passage:
    """The samples as the "release-2022" quadrature places and masks them."""
    jitter = None
    if settings.jitter:
        jitter = torch.rand(index.shape[0], count, device=index.device)
    depth = place_samples(chord.near[index], chord.far[index], count, jitter)
    points = _points(chord, index, depth)
    config, frame = each.field.config, rays.frame[index]
    inside = within(points, points.new_tensor(config.low), points.new_tensor(config.high))
    inside = inside & (index < rays.frame.shape[0] - 1)[:, None]
    coordinates = each.field.coordinates(points).clamp(-1.0, 1.0)
    # A third of the samples lies outside, where nothing needs to be evaluated.
    row, column = torch.nonzero(inside, as_tuple=True)
    filled = padded(row, settings.bucket, 0), padded(column, settings.bucket, 0)
    evaluated = each.field.trunk(coordinates[filled][:, None], frame[filled[0]], each.pose)
    # What fills the bucket goes nowhere: put back, each of it would count in the gradient.
    evaluated = evaluated[: row.shape[0]]
    hidden = evaluated.new_zeros(*depth.shape, evaluated.shape[-1])
    hidden = hidden.index_put((row, column), evaluated[:, 0])
    density = each.field.densities(evaluated, settings.density_noise)[:, 0]
    density = torch.zeros_like(depth).index_put((row, column), density)
    length = chord.directions[index].norm(dim=-1)
    thickness = torch.where(inside, density * length[:, None], 0.0)
    elsewhere = depth_range(config, settings)[0]
    return Passage(index, frame, depth, coordinates, thickness, hidden, elsewhere)


def _points(chord: _Chord, index: Tensor, depth: Tensor) -> Float[Tensor, "hits samples 3"]:
    return chord.origins[index][:, None] + depth[..., None] * chord.directions[index][:, None]


def depth_range(config: ObjectClassConfig, settings: RenderSettings) -> tuple[float, float]:
    """Planar depths in metres between which the samples of "release-2022" lie."""
    return config.depth_range or (settings.near, torch.inf)


def _sky(rays: Rays, each: SceneObject, settings: RenderSettings) -> Passage:
    """A sky fills every ray behind everything else; V is asked for the ray's direction."""
    config = each.field.config
    index = torch.nonzero(each.visible[rays.frame[:-1]])[:, 0]
    frame, directions = rays.frame[index], rays.directions[index]
    coordinates = (directions / directions.norm(dim=-1, keepdim=True)).float()
    if config.sees_origin:
        size = directions.new_tensor(config.high) - directions.new_tensor(config.low)
        place = (rays.centres - each.position.double()) / size
        coordinates = torch.cat([coordinates, place[frame].float()], dim=-1)
    at = SKY_DEPTH if config.depth_range is None else config.depth_range[0]
    depth = torch.full((index.shape[0], 1), at, device=index.device)
    opaque = OPAQUE if settings.release is None else SKY_DENSITY
    thickness = torch.full(depth.shape, opaque, device=index.device)
    elsewhere = 2 * SKY_DEPTH if settings.release is None else at
    return Passage(index, frame, depth, coordinates[:, None], thickness, None, elsewhere)


def turn(angle: Float[Tensor, " frames"]) -> Float[Tensor, "frames 3 3"]:
    """Rotations about the world's z axis."""
    cos, sin, zero = angle.cos(), angle.sin(), torch.zeros_like(angle)
    rows = [cos, -sin, zero, sin, cos, zero, zero, zero, zero + 1]
    return torch.stack(rows, dim=-1).unflatten(-1, (3, 3))
