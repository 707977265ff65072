"""Object volumes: axis-aligned boxes in the object's frame, met by rays and seen by cameras."""

import itertools

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from pe_runtime.geometry.cameras import Cameras, project

EDGE_POINTS = 5
"""Points within each edge that stand for it where a volume reaches behind the camera."""

NEAREST = 1e-3
"""Depth, in diagonals of a volume, that its corners need to lie in front of the camera."""


def intersect_box(
    origins: Float[Tensor, "rays 3"],
    directions: Float[Tensor, "rays 3"],
    low: Float[Tensor, "3"],
    high: Float[Tensor, "3"],
    near: float,
    offset: Float[Tensor, "3"] | None = None,
) -> tuple[Float[Tensor, " rays"], Float[Tensor, " rays"], Bool[Tensor, " rays"]]:
    """Where rays enter and leave a box (slab method).

    Args:
        origins: Ray origins in the box's frame, metres.
        directions: Ray directions; need not be normalised, may have zero components.
        low: Lower corner, metres.
        high: Upper corner, metres.
        near: Ray parameter before which nothing counts; a camera inside the box enters there.
        offset: Added to the directions for the crossings (the "release-2022" quadrature).

    Returns:
        Entry and exit parameters, and whether the ray passes through the box at all. Both are 0
        where it does not. A ray that only touches an edge or a face passes through nothing, nor
        does any ray through a box that is flat or upside down.
    """
    if offset is not None:
        directions = directions + offset
    # A crossing's gradient is (face - origin) / d^2, which must not overflow.
    parallel = directions.abs() < torch.finfo(directions.dtype).tiny ** 0.25
    safe = torch.where(parallel, torch.ones_like(directions), directions)
    first = (low - origins) / safe
    second = (high - origins) / safe
    # A ray parallel to a slab is inside it for ever or never; 0/0 would say NaN.
    inside = (origins > low) & (origins < high)
    infinity = torch.full_like(first, torch.inf)
    enters = torch.where(inside, -infinity, infinity)
    entry = torch.where(parallel, enters, torch.minimum(first, second)).amax(dim=-1)
    leave = torch.where(parallel, -enters, torch.maximum(first, second)).amin(dim=-1)
    entry = entry.clamp(min=near)
    hit = (leave > entry) & torch.isfinite(entry) & torch.isfinite(leave) & (low < high).all()
    return torch.where(hit, entry, 0.0), torch.where(hit, leave, 0.0), hit


def corners(low: Float[Tensor, "3"], high: Float[Tensor, "3"]) -> Float[Tensor, "8 3"]:
    """The eight corners of a box."""
    picks = torch.tensor(list(itertools.product((0, 1), repeat=3)), device=low.device)
    return torch.where(picks == 0, low, high)


def box_in_image(
    cameras: Cameras,
    positions: Float[Tensor, "frames 3"],
    low: Float[Tensor, "3"],
    high: Float[Tensor, "3"],
    headings: Float[Tensor, " frames"] | None = None,
) -> tuple[Float[Tensor, "frames 4"], Bool[Tensor, " frames"]]:
    """Tight image box (left, top, right, bottom; pixels, not clipped) of an object's volume.

    Args:
        cameras: One camera per frame.
        positions: Where the object stands, metres.
        low: Lower corner, metres, object's frame.
        high: Upper corner, metres, object's frame.
        headings: By how much the object is turned about the world's z axis, radians.

    Returns:
        Boxes, and whether all corners lie in front of the camera; the box is of no use otherwise.
    """
    points = _turned(corners(low, high).double(), headings)
    pixels, depth = project(cameras, positions[:, None].double() + points)
    boxes = torch.cat([pixels.amin(dim=1), pixels.amax(dim=1)], dim=-1)
    return boxes, (depth > NEAREST * (high - low).norm()).all(dim=-1)


def outline(low: Float[Tensor, "3"], high: Float[Tensor, "3"]) -> Float[Tensor, "points 3"]:
    """The corners of a box and, evenly spaced, `EDGE_POINTS` within each of its twelve edges."""
    ends = corners(low, high)
    edges = [(a, a | bit) for a in range(8) for bit in (1, 2, 4) if not a & bit]
    first, second = torch.tensor(edges, device=low.device).unbind(dim=1)
    shares = torch.arange(1, EDGE_POINTS + 1, device=low.device, dtype=low.dtype)
    shares = shares[:, None, None] / (EDGE_POINTS + 1)
    within = ends[first] + shares * (ends[second] - ends[first])
    return torch.cat([ends, within.flatten(0, 1)])


def visible_box_in_image(
    cameras: Cameras,
    positions: Float[Tensor, "frames 3"],
    low: Float[Tensor, "3"],
    high: Float[Tensor, "3"],
    headings: Float[Tensor, " frames"] | None = None,
) -> tuple[Float[Tensor, "frames 4"], Bool[Tensor, " frames"]]:
    """Image box (left, top, right, bottom; pixels) of what the picture shows of a volume.

    Unlike `box_in_image` it holds for a volume around the camera: of the volume's outline, points
    behind the camera are left out, and the box is clipped to the picture. A volume out of sight
    gives a box without area on the picture's border.

    Args: as of `box_in_image`.

    Returns:
        Boxes, and whether anything lies in front of the camera; the box is of no use otherwise.
    """
    points = _turned(outline(low.double(), high.double()), headings)
    pixels, depth = project(cameras, positions[:, None].double() + points)
    ahead = depth > 0
    first = torch.where(ahead[..., None], pixels, torch.inf).amin(dim=1)
    last = torch.where(ahead[..., None], pixels, -torch.inf).amax(dim=1)
    size = positions.new_tensor([cameras.width, cameras.height] * 2).double()
    boxes = torch.cat([first, last], dim=-1).clamp(min=0)
    return torch.minimum(boxes, size), ahead.any(dim=1)


def _turned(
    points: Float[Tensor, "points 3"], headings: Float[Tensor, " frames"] | None
) -> Float[Tensor, "#frames points 3"]:
    """Points of an object's frame in the world's axes, about its position."""
    if headings is None:
        return points[None]
    x, y, z = points.unbind(dim=-1)
    cosine, sine = headings.double().cos()[:, None], headings.double().sin()[:, None]
    across, along = cosine * x - sine * y, sine * x + cosine * y
    return torch.stack([across, along, z.expand_as(across)], dim=-1)
