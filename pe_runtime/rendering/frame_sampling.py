"""One object in one frame: which rays meet it, and how dense it is where they do.

The same numbers as `passages.pass_through`, for one frame, without gradients, and with whatever
need not be done left out: rays outside the volume's outline, samples outside the volume, empty
space (`occupancy`), and samples behind what lets no light through (`termination`).
"""

from collections.abc import Sequence

import torch
from jaxtyping import Float, Int
from torch import Tensor

from pe_runtime.geometry.boxes import corners
from pe_runtime.geometry.cameras import project
from pe_runtime.rendering.compositing import OPAQUE
from pe_runtime.rendering.frame_passages import FrameObject, FramePassage, FrameRays
from pe_runtime.rendering.occupancy import occupied
from pe_runtime.rendering.passages import SKY_DEPTH, depth_range, meet, turn
from pe_runtime.rendering.release_2022 import SKY_DENSITY, place_samples, within
from pe_runtime.rendering.sampling import sample_intervals
from pe_runtime.rendering.scene import RenderSettings

MARGIN = 0.5
"""Pixels around a volume's outline within which rays are still tried."""


def frame_passage(
    rays: FrameRays,
    each: FrameObject,
    settings: RenderSettings,
    before: Sequence[FramePassage] = (),
) -> FramePassage:
    """Sample one object on the rays of a frame.

    Args:
        rays: The rays.
        each: The object.
        settings: Sampling and skipping.
        before: Passages of objects that may stand in front (for `termination`).
    """
    if each.field.config.kind == "sky":
        return _sky(rays, each, settings)
    config = each.field.config
    index = _candidates(rays, each)
    if index.numel() == 0 and not config.opaque:
        return _missed(rays, each, index, settings)
    origins = (rays.camera.centres[0] - each.position.double()).expand(len(index), 3)
    directions = rays.directions[index]
    if each.heading:
        angle = torch.tensor([-each.heading], dtype=torch.float64, device=index.device)
        object_from_world = turn(angle)[0]
        origins = origins @ object_from_world.T
        directions = directions.double() @ object_from_world.T
    if settings.release is not None:
        origins, directions = origins.float(), directions.float()
    low, high = origins.new_tensor(config.low), origins.new_tensor(config.high)
    near, far, hit = meet(origins, directions, (low, high), config, settings)
    kept = torch.nonzero(hit)[:, 0]
    index, near, far = index[kept], near[kept], far[kept]
    # Component by component: rows of three would be the slowest way through memory.
    line = tuple(each[kept].T.contiguous()[..., None] for each in (origins, directions))
    if config.opaque:
        return _opaque(rays, each, index, (near, line))
    count = max(1, round(config.samples * settings.sample_share))
    if settings.release is None:
        depth, step = sample_intervals(near, far, count)
        length = step.float() * rays.lengths[index]
        inside = None
    else:
        depth = place_samples(near, far, count)
        length = rays.lengths[index]
        inside = within(_points(line, depth).movedim(0, -1), low, high)
    coordinates = _coordinates(line, depth, low, high)
    wanted = _wanted(rays, each, settings, (index, depth, coordinates), before)
    wanted = wanted if inside is None else inside if wanted is None else wanted & inside
    if wanted is not None and settings.release is None:
        # Under "release-2022" even empty samples end what stands before them.
        some = torch.nonzero(wanted.any(dim=1))[:, 0]
        index, wanted = index[some], wanted[some]
        depth, length, coordinates = depth[some], length[some], coordinates[:, some]
    return _evaluated(
        rays, each, index, ((depth - rays.base).float(), length, coordinates), wanted, settings
    )


def _missed(
    rays: FrameRays, each: FrameObject, nobody: Tensor, settings: RenderSettings
) -> FramePassage:
    """The passage of a volume that is out of view."""
    none = torch.zeros(0, 1, device=nobody.device)
    hidden = each.field.trunk.layers[-1].bias.new_zeros(0, 1)
    ours = settings.release is None
    elsewhere = 2 * SKY_DEPTH if ours else depth_range(each.field.config, settings)[0]
    places = none.expand(0, 3)
    row_of = _rows_of(rays, nobody)
    return FramePassage(each, nobody, row_of, none, none, none.long(), places, hidden, elsewhere)


def _points(line: tuple[Tensor, Tensor], depth: Tensor) -> Float[Tensor, "3 hits samples"]:
    """Points at depths of rays, object frame, metres."""
    origins, directions = line
    return origins + depth * directions


def _coordinates(
    line: tuple[Tensor, Tensor], depth: Tensor, low: Tensor, high: Tensor
) -> Float[Tensor, "3 hits samples"]:
    """The same in half box sizes around the volume's middle; float32."""
    middle, extent = ((low + high) / 2)[:, None, None], ((high - low) / 2)[:, None, None]
    return ((_points(line, depth) - middle) / extent).float().clamp_(-1.0, 1.0)


def _evaluated(
    rays: FrameRays,
    each: FrameObject,
    index: Tensor,
    samples: tuple[Tensor, Tensor, Tensor],
    wanted: Tensor | None,
    settings: RenderSettings,
) -> FramePassage:
    """Densities of the wanted samples; all others are empty."""
    depth, length, coordinates = samples
    if wanted is None:
        rows = coordinates.flatten(1).T.contiguous()
        slot = torch.arange(rows.shape[0], device=index.device).reshape(depth.shape)
        hidden, density = each.field.geometry(rows)
        thickness = density.reshape(depth.shape) * length[:, None]
    else:
        rows = coordinates[:, wanted].T.contiguous()
        slot = torch.full(depth.shape, -1, device=index.device)
        slot[wanted] = torch.arange(rows.shape[0], device=index.device)
        hidden, density = each.field.geometry(rows)
        thickness = torch.zeros_like(depth)
        thickness[wanted] = density
        thickness = thickness * length[:, None]
    ours = settings.release is None
    elsewhere = 2 * SKY_DEPTH if ours else depth_range(each.field.config, settings)[0]
    row_of = _rows_of(rays, index)
    return FramePassage(each, index, row_of, depth, thickness, slot, rows, hidden, elsewhere)


def _depth_of_light(thickness: Tensor, depth: Tensor, settings: RenderSettings) -> Tensor:
    """Optical thickness of samples, as far as their own object knows it."""
    if settings.release is None:
        return thickness
    gaps = torch.zeros_like(depth)
    gaps[:, :-1] = depth.diff(dim=1)
    return thickness * gaps


def _wanted(
    rays: FrameRays,
    each: FrameObject,
    settings: RenderSettings,
    samples: tuple[Tensor, Tensor, Tensor],
    before: Sequence[FramePassage],
) -> Tensor | None:
    """Which samples have to be evaluated; None for all of them."""
    index, depth, coordinates = samples
    wanted = None
    if settings.occupancy and each.field.config.kind == "playable":
        wanted = occupied(each.field, coordinates, always=bool(rays.parts))
    if settings.termination > 0 and before:
        lit = (
            light_at(before, index, (depth[:, :1] - rays.base).float(), settings)
            > settings.termination
        )
        lit = lit.expand(depth.shape)
        wanted = lit if wanted is None else wanted & lit
    return wanted


def light_at(
    passages: Sequence[FramePassage],
    rays: Int[Tensor, " hits"],
    depth: Float[Tensor, "hits 1"],
    settings: RenderSettings,
) -> Float[Tensor, "hits 1"]:
    """Share of light that other objects let through to given depths of rays."""
    total = torch.zeros_like(depth)
    for each in passages:
        rows = each.row_of[rays]
        met = torch.nonzero(rows >= 0)[:, 0]
        if met.numel() == 0:
            continue
        at = each.depth[rows[met]]
        thickness = _depth_of_light(each.thickness[rows[met]], at, settings)
        total[met] += torch.where(at < depth[met], thickness, 0.0).sum(dim=1, keepdim=True)
    return torch.exp(-total)


def _opaque(
    rays: FrameRays, each: FrameObject, index: Tensor, entry: tuple[Tensor, tuple]
) -> FramePassage:
    """Nothing behind an opaque surface can be seen: the one sample is where the ray enters."""
    near, line = entry
    depth = near[:, None]
    low, high = (
        near.new_tensor(bound) for bound in (each.field.config.low, each.field.config.high)
    )
    coordinates = _coordinates(line, depth, low, high)[..., 0].T.contiguous()
    return _surface(
        rays, each, index, ((depth - rays.base).float(), OPAQUE), coordinates, 2 * SKY_DEPTH
    )


def _sky(rays: FrameRays, each: FrameObject, settings: RenderSettings) -> FramePassage:
    """A sky fills every ray behind everything else; V is asked for the ray's direction."""
    config = each.field.config
    directions = rays.directions
    coordinates = (directions / directions.norm(dim=-1, keepdim=True)).float()
    if config.sees_origin:
        size = each.position.new_tensor(config.high) - each.position.new_tensor(config.low)
        place = (rays.camera.centres[0] - each.position.double()) / size
        coordinates = torch.cat([coordinates, place.float().expand(len(rays), 3)], dim=-1)
    at = SKY_DEPTH if config.depth_range is None else config.depth_range[0]
    index = torch.arange(len(rays) if each.visible else 0, device=directions.device)
    coordinates = coordinates[: index.shape[0]]
    depth = torch.full((index.shape[0], 1), at, device=directions.device)
    ours = settings.release is None
    thickness, elsewhere = (OPAQUE, 2 * SKY_DEPTH) if ours else (SKY_DENSITY, at)
    return _surface(rays, each, index, (depth, thickness), coordinates, elsewhere)


def _surface(
    rays: FrameRays,
    each: FrameObject,
    index: Tensor,
    place: tuple[Tensor, float],
    coordinates: Tensor,
    elsewhere: float,
) -> FramePassage:
    depth, thickness = place
    slot = torch.arange(index.shape[0], device=index.device)[:, None]
    thick = torch.full_like(depth, thickness)
    row_of = _rows_of(rays, index)
    return FramePassage(each, index, row_of, depth, thick, slot, coordinates, None, elsewhere)


def _rows_of(rays: FrameRays, index: Tensor) -> Tensor:
    row_of = torch.full((len(rays),), -1, device=index.device)
    row_of[index] = torch.arange(index.shape[0], device=index.device)
    return row_of


def _candidates(rays: FrameRays, each: FrameObject) -> Int[Tensor, " candidates"]:
    """Rays within the outline of the volume; all of them if it reaches behind the camera."""
    config = each.field.config
    low, high = each.position.new_tensor(config.low), each.position.new_tensor(config.high)
    edges = corners(low.double(), high.double())
    if each.heading:
        angle = torch.tensor([each.heading], dtype=torch.float64, device=edges.device)
        edges = edges @ turn(angle)[0].T
    pixels, depth = project(rays.camera, (edges + each.position.double())[None])
    nearest, farthest = depth.aminmax()
    if farthest <= 0:
        return torch.zeros(0, dtype=torch.long, device=edges.device)
    if nearest <= 1e-3:
        return torch.arange(len(rays), device=edges.device)
    left, top = (pixels[0].amin(dim=0) - MARGIN).tolist()
    right, bottom = (pixels[0].amax(dim=0) + MARGIN).tolist()
    u, v = rays.pixels.unbind(dim=1)
    within_outline = (u >= left) & (u <= right) & (v >= top) & (v <= bottom)
    return torch.nonzero(within_outline)[:, 0]
