"""Where the rays of a float64 reference are sampled, in both quadratures.

"interval" is float64 throughout. "release-2022" places its samples in float32, because its authors
did and the highest octaves of thin, distant volumes show it: rounding is part of that quadrature.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from pe_runtime.benchmark.reference_field import ReferenceField
from pe_runtime.config import ModelConfig, ObjectClassConfig
from pe_runtime.contract.camera import Camera
from pe_runtime.geometry.cameras import Cameras, ray_directions
from pe_runtime.geometry.native_world import WORLD_FROM_NATIVE
from pe_runtime.state import ObjectState

SKY_DEPTH = 1e30
OFFSET = 1e-6
"""What "release-2022" adds to each direction component, in its authors' axes."""


@dataclass(frozen=True)
class Places:
    """The samples of one object on a bundle of rays.

    Attributes:
        depth: Planar depths; samples that are not there count for the order only.
        there: Which samples are within the object.
        coordinates: Where the field is asked, float64.
        length: Metres of path for which a sample stands; under "release-2022" per metre of depth.
    """

    depth: Float[Tensor, "rays samples"]
    there: Bool[Tensor, "rays samples"]
    coordinates: Float[Tensor, "rays samples dims"]
    length: Float[Tensor, " rays"]


def places_of(
    config: ModelConfig,
    field: ReferenceField,
    state: ObjectState,
    camera: Camera,
    pixels: Float[Tensor, "rays 2"],
) -> Places:
    """Sample one object on the rays through some pixels."""
    released = config.quadrature == "release-2022"
    kind = field.config
    frame = torch.zeros(pixels.shape[0], dtype=torch.long)
    dtype = torch.float32 if released else torch.float64
    directions = ray_directions(Cameras.stack([camera]), frame, pixels, dtype).double()
    centre = torch.from_numpy(camera.world_from_camera[:3, 3].copy())
    origin = centre - state.position.double().cpu()
    if kind.kind == "sky":
        return _sky(kind, origin, directions, state.visible)
    if state.heading:
        turn = _about_z(-float(torch.tensor(state.heading)))
        origin, directions = turn @ origin, directions @ turn.T
    if released:
        return _released(config, field, origin.float(), directions.float())
    return _intervals(config, field, origin, directions)


def _intervals(
    config: ModelConfig, field: ReferenceField, origin: Tensor, directions: Tensor
) -> Places:
    """One sample in the middle of each interval; for opaque volumes one where the ray enters."""
    kind = field.config
    entry, leave = _crossings(kind, origin, directions)
    entry = entry.clamp(min=config.near)
    hit = (leave > entry) & entry.isfinite() & leave.isfinite()
    entry, leave = (torch.where(hit, each, 0.0) for each in (entry, leave))
    count, place = (1, 0.0) if kind.opaque else (kind.samples, 0.5)
    step = (leave - entry) / count
    depth = entry[:, None] + (torch.arange(count) + place) * step[:, None]
    points = origin + depth[..., None] * directions[:, None]
    there = hit[:, None].expand(-1, count)
    length = step * directions.norm(dim=-1)
    return Places(torch.where(there, depth, torch.inf), there, field.coordinates(points), length)


def _released(
    config: ModelConfig, field: ReferenceField, origin: Tensor, directions: Tensor
) -> Places:
    """Even samples from the first crossing to the last, those outside the volume not there."""
    kind, count = field.config, field.config.samples
    first, last = kind.depth_range or (config.near, math.inf)
    offset = WORLD_FROM_NATIVE[config.native_up] @ torch.full((3,), OFFSET, dtype=torch.float64)
    entry, leave = _crossings(kind, origin, directions + directions.new_tensor(offset.tolist()))
    hit = (leave > entry) & entry.isfinite() & leave.isfinite() & (leave >= first)
    entry, leave = (
        torch.where(hit, each.clamp(first, last), first)[:, None] for each in (entry, leave)
    )
    share = torch.linspace(0.0, 1.0, count, dtype=origin.dtype)
    depth = entry * (1 - share) + leave * share
    points = origin + depth[..., None] * directions[:, None]
    low, high = points.new_tensor(kind.low), points.new_tensor(kind.high)
    inside = ((points >= low) & (points <= high)).all(dim=-1) & hit[:, None]
    length = directions.double().norm(dim=-1)
    return Places(depth.double(), inside, field.coordinates(points.double()), length)


def _crossings(
    kind: ObjectClassConfig, origin: Tensor, directions: Tensor
) -> tuple[Float[Tensor, " rays"], Float[Tensor, " rays"]]:
    """Where rays enter and leave a box, face by face; entry after exit where they miss it."""
    entry = torch.full_like(directions[:, 0], -math.inf)
    leave = torch.full_like(directions[:, 0], math.inf)
    for axis in range(3):
        low, high = (directions.new_tensor(each[axis]) for each in (kind.low, kind.high))
        o, d = origin[axis], directions[:, axis]
        one, other = (low - o) / d, (high - o) / d
        # A ray parallel to the faces is between them for ever or never.
        between = math.inf if low < o < high else -math.inf
        entry = torch.maximum(entry, torch.where(d == 0, -between, torch.minimum(one, other)))
        leave = torch.minimum(leave, torch.where(d == 0, between, torch.maximum(one, other)))
    return entry, leave


def _sky(kind: ObjectClassConfig, origin: Tensor, directions: Tensor, visible: bool) -> Places:
    """One sample behind everything, asked for its direction."""
    coordinates = directions / directions.norm(dim=-1, keepdim=True)
    if kind.sees_origin:
        size = directions.new_tensor(kind.high) - directions.new_tensor(kind.low)
        coordinates = torch.cat([coordinates, (origin / size).expand_as(coordinates)], dim=-1)
    depth = SKY_DEPTH if kind.depth_range is None else kind.depth_range[0]
    one = torch.ones_like(coordinates[:, :1])
    return Places(depth * one, visible & (one > 0), coordinates[:, None], one[:, 0])


def _about_z(angle: float) -> Float[Tensor, "3 3"]:
    cos, sin = math.cos(angle), math.sin(angle)
    rows = [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]
    return torch.tensor(rows, dtype=torch.float64)
