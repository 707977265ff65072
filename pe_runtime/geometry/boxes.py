"""Object volumes: axis-aligned boxes in the object's frame, met by rays and seen by cameras."""

import itertools

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from pe_runtime.geometry.cameras import Cameras, project


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
        where it does not. A ray that only touches an edge or a face passes through nothing.
    """
    if offset is not None:
        directions = directions + offset
    parallel = directions == 0
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
    hit = (leave > entry) & torch.isfinite(entry) & torch.isfinite(leave)
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
) -> tuple[Float[Tensor, "frames 4"], Bool[Tensor, " frames"]]:
    """Tight image box (left, top, right, bottom; pixels, not clipped) of an object's volume.

    Returns:
        Boxes, and whether all corners lie in front of the camera; the box is of no use otherwise.
    """
    world = positions[:, None].double() + corners(low, high).double()
    pixels, depth = project(cameras, world)
    boxes = torch.cat([pixels.amin(dim=1), pixels.amax(dim=1)], dim=-1)
    return boxes, (depth > 1e-3).all(dim=-1)
