"""The truth that pictures are measured against: one frame in float64, every sample of every ray.

No buckets, no chunks that share anything, nothing folded, reused or left out: rays, samples, V,
weights, features, F, in this order. Both quadratures; `finer` multiplies the samples, so that the
same code gives the converged integral.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pe_runtime.benchmark.reference_decoder import decode
from pe_runtime.benchmark.reference_field import ReferenceField, Weights
from pe_runtime.benchmark.reference_places import Places, places_of
from pe_runtime.config import ModelConfig
from pe_runtime.contract.camera import Camera
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.state import EnvironmentState, ObjectState

LAST_GAP = 1e10
"""Metres for which the last sample of a ray extends, under "release-2022"."""
SKY_DENSITY = 10.0
"""Of a sky, under "release-2022"."""
OPAQUE = 1e4
"""Optical thickness of opaque surfaces."""
SAMPLES = 1 << 16
"""Samples that are composed at once."""


@dataclass(frozen=True)
class ReferenceObject:
    """One object that the renderer would know of."""

    state: ObjectState
    field: ReferenceField


@torch.no_grad()
def reference_picture(
    environment: PlayableEnvironment, state: EnvironmentState, camera: Camera, finer: int = 1
) -> Float[np.ndarray, "height width 3"]:
    """Draw a state in float64.

    Args:
        environment: The model.
        state: What to draw.
        camera: From where.
        finer: So many times the samples that the model asks for.

    Returns:
        sRGB in [0, 1].
    """
    config = environment.config
    weights = _weights(environment)
    objects = _objects(config, weights, state, finer)
    strides, widths = config.feature_renderer.strides, config.feature_renderer.features
    cells = [max(2, -(-extent // strides[-1])) for extent in (camera.height, camera.width)]
    maps, first = [], 0
    for stride, width in zip(strides, widths, strict=True):
        rows, columns = (count * strides[-1] // stride for count in cells)
        channels = slice(first, first + width)
        features = _map_features(config, objects, camera, (rows, columns, stride), channels)
        maps.append(features.T.reshape(1, width, rows, columns))
        first += width
    picture = decode(maps, below(weights, "feature_renderer."), config.feature_renderer)
    return picture[:, : camera.height, : camera.width].permute(1, 2, 0).numpy()


@torch.no_grad()
def reference_features(
    environment: PlayableEnvironment,
    state: EnvironmentState,
    camera: Camera,
    pixels: Float[Tensor, "rays 2"],
    channels: slice,
) -> Float[Tensor, "rays channels"]:
    """What the rays through some pixels see, float64, before the ConvNet."""
    config = environment.config
    objects = _objects(config, _weights(environment), state, 1)
    return _look(config, objects, camera, pixels, channels)


def _weights(environment: PlayableEnvironment) -> Weights:
    return {n: t.double().cpu() for n, t in environment.networks.state_dict().items()}


def below(weights: Weights, prefix: str) -> Weights:
    """The tensors whose names begin so, by the rest of their names."""
    return {n.removeprefix(prefix): t for n, t in weights.items() if n.startswith(prefix)}


def _objects(
    config: ModelConfig, weights: Weights, state: EnvironmentState, finer: int
) -> list[ReferenceObject]:
    found = []
    for each in config.objects:
        kind, own = config.classes[each.class_name], state[each.name]
        # In the authors' quadrature even a hidden sky ends what stands before it.
        kept = kind.kind == "sky" and config.quadrature == "release-2022"
        if own.visible or kept:
            named = below(weights, f"fields.{each.class_name}.")
            kind = replace(kind, samples=finer * kind.samples)
            field = ReferenceField(kind, named, own.style.double().cpu(), own.pose.double().cpu())
            found.append(ReferenceObject(own, field))
    return found


def _map_features(
    config: ModelConfig,
    objects: Sequence[ReferenceObject],
    camera: Camera,
    grid: tuple[int, int, int],
    channels: slice,
) -> Float[Tensor, "rays channels"]:
    """Features of the rays of one map, row by row; the grid is rows, columns, stride."""
    rows, columns, stride = grid
    v, u = (torch.arange(n, dtype=torch.float64) + 0.5 for n in (rows, columns))
    pixels = torch.cartesian_prod(v, u).flip(-1) * stride
    samples = sum(each.field.config.samples for each in objects)
    parts = pixels.split(max(1, SAMPLES // max(1, samples)))
    return torch.cat([_look(config, objects, camera, part, channels) for part in parts])


def _look(
    config: ModelConfig,
    objects: Sequence[ReferenceObject],
    camera: Camera,
    pixels: Float[Tensor, "rays 2"],
    channels: slice,
) -> Float[Tensor, "rays channels"]:
    """What the rays through some pixels see."""
    rays = pixels.shape[0]
    places = [places_of(config, each.field, each.state, camera, pixels) for each in objects]
    weights = compose(config, [each.field for each in objects], places)
    features = torch.zeros(rays, channels.stop - channels.start, dtype=torch.float64)
    for each, at, weight in zip(objects, places, weights, strict=True):
        seen = features.new_zeros(*at.there.shape, features.shape[1])
        seen[at.there] = each.field.features(at.coordinates[at.there], channels)
        features = features + torch.einsum("rs,rsc->rc", weight, seen)
    return features


def compose(
    config: ModelConfig, fields: Sequence[ReferenceField], places: Sequence[Places]
) -> list[Float[Tensor, "rays _"]]:
    """Weight of every sample of every object, all of them sorted along their rays (eq. 1)."""
    released = config.quadrature == "release-2022"
    thickness = [_thickness(*each, released) for each in zip(fields, places, strict=True)]
    depth = [at.depth for at in places]
    if released and config.carve_overlaps:
        depth, thickness = _carved(fields, depth, thickness)
    if not places:
        return []
    depth, order = torch.cat(depth, dim=1).sort(dim=1, stable=True)
    thickness = torch.cat(thickness, dim=1).gather(1, order)
    if released:
        gaps = torch.full_like(depth, LAST_GAP)
        gaps[:, :-1] = depth[:, 1:] - depth[:, :-1]
        thickness = thickness * gaps
    light, weights = torch.ones_like(depth[:, 0]), torch.zeros_like(depth)
    for sample in range(depth.shape[1]):
        weights[:, sample] = light * -torch.expm1(-thickness[:, sample])
        light = light * torch.exp(-thickness[:, sample])
    weights = torch.zeros_like(weights).scatter(1, order, weights)
    return list(weights.split([at.depth.shape[1] for at in places], dim=1))


def _thickness(field: ReferenceField, at: Places, released: bool) -> Float[Tensor, "rays samples"]:
    """Optical thickness of the samples; under "release-2022" per metre of depth."""
    if field.config.kind == "sky" or field.config.opaque:
        return at.there * (SKY_DENSITY if released else OPAQUE)
    density = at.length.new_zeros(at.there.shape)
    density[at.there] = field.density(at.coordinates[at.there])
    return density * at.length[:, None]


def _carved(
    fields: Sequence[ReferenceField], depth: Sequence[Tensor], thickness: Sequence[Tensor]
) -> tuple[list[Tensor], list[Tensor]]:
    """Static samples within a player's passage left out, and put at depth 0."""
    depth, thickness = list(depth), list(thickness)
    players = [d for f, d in zip(fields, depth, strict=True) if f.config.kind == "playable"]
    for number, field in enumerate(fields):
        if field.config.kind == "playable":
            continue
        own = depth[number]
        kept = torch.ones_like(own, dtype=torch.bool)
        for other in players:
            # The passage's end is taken at the sample whose number is the static object's last.
            end = other[:, min(own.shape[1], other.shape[1]) - 1]
            kept &= (own < other[:, :1]) | (own >= end[:, None])
        depth[number] = torch.where(kept, own, 0.0)
        thickness[number] = torch.where(kept, thickness[number], 0.0)
    return depth, thickness
