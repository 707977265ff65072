"""The quadrature of the paper's authors, `quadrature = "release-2022"`, which their weights expect.

How it differs from ours ("interval"), in the order in which a ray meets it:

1. A ray meets a volume's faces at (face - origin) / (direction + 1e-6), component by component in
   their axes. The crossings lie a little beyond the faces for negative components and a little
   before them for positive ones.
2. Passages are cut to the class's `depth_range`.
3. N samples lie evenly from the first crossing to the last, both ends included, at depths
   t = near (1 - s) + far s and positions o + t d in float32. In thin, distant volumes (the tennis
   backplate) the highest octaves show the rounding, so the order of operations is kept.
4. Samples outside the volume count as empty space. By 1. that loses one end of nearly every
   passage, always by far more than rounding.
5. A sample's thickness extends to the next sample of *any* object on its ray, empty or not; the
   samples of objects that a ray misses all lie at the near end of their depth range.
6. The last sample of a ray extends for ever (1e10).
7. With `carve_overlaps`, samples of static objects within a player's passage are dropped; the
   passage's end is taken at the player's sample whose number is that of the *static* object's last.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from pe_runtime.config import ModelConfig
from pe_runtime.geometry.native_world import WORLD_FROM_NATIVE

OFFSET = 1e-6
"""What is added to each direction component, in their axes."""

LAST_GAP = 1e10
"""Planar depth over which the last sample of a ray extends."""

SKY_DENSITY = 10.0
"""Density of a sky, which is what is left at the end of the ray."""


@dataclass(frozen=True)
class Release2022:
    """What the quadrature has to know about a model.

    Attributes:
        offset: The summands of direction components, in our axes.
        carve: Whether players carve their passages out of static objects.
    """

    offset: tuple[float, float, float]
    carve: bool


def release_2022(config: ModelConfig) -> Release2022 | None:
    """The quadrature as a model wants it; None for models that are sampled our way."""
    if config.quadrature != "release-2022":
        return None
    offset = WORLD_FROM_NATIVE[config.native_up] @ torch.full((3,), OFFSET, dtype=torch.float64)
    return Release2022(tuple(offset.tolist()), config.carve_overlaps)


def place_samples(
    near: Float[Tensor, " rays"],
    far: Float[Tensor, " rays"],
    count: int,
    jitter: Float[Tensor, "rays samples"] | None = None,
) -> Float[Tensor, "rays samples"]:
    """Even samples from near to far, both included (3.); a single one is at near.

    Args:
        near: Planar depths of the first samples.
        far: Planar depths of the last samples.
        count: Samples per ray.
        jitter: In [0, 1): place of each sample between the middles to its neighbours.
    """
    share = torch.linspace(0.0, 1.0, count, dtype=near.dtype, device=near.device)
    depth = near[:, None] * (1 - share) + far[:, None] * share
    if jitter is None or count == 1:
        return depth
    middles = (depth[:, 1:] + depth[:, :-1]) / 2
    lower = torch.cat([depth[:, :1], middles], dim=1)
    upper = torch.cat([middles, depth[:, -1:]], dim=1)
    return lower + jitter * (upper - lower)


def within(
    points: Float[Tensor, "*batch 3"], low: Float[Tensor, "3"], high: Float[Tensor, "3"]
) -> Bool[Tensor, "*batch"]:
    """Whether points lie in a volume, faces included (4.)."""
    return ((points >= low) & (points <= high)).all(dim=-1)


def thickness_to_next(
    depth: Float[Tensor, "rays samples"], density: Float[Tensor, "rays samples"]
) -> Float[Tensor, "rays samples"]:
    """Optical thickness of sorted samples up to the next one (5., 6.), tau_i = s_i (t_i+1 - t_i).

    Args:
        depth: Planar depths, nearest first.
        density: Optical thickness per metre of planar depth.
    """
    gaps = torch.full_like(depth, LAST_GAP)
    gaps[:, :-1] = depth[:, 1:] - depth[:, :-1]
    # A sample that extends over nothing is nothing, however dense: infinity times 0 is no number.
    return density.clamp(max=torch.finfo(density.dtype).max) * gaps.to(density)


def carve(
    depth: Float[Tensor, "rays samples"],
    density: Float[Tensor, "rays samples"],
    static: Sequence[slice],
    players: Sequence[slice],
) -> tuple[Float[Tensor, "rays samples"], Float[Tensor, "rays samples"]]:
    """Drop static samples within players' passages (7.): density 0, and out of the way at depth 0.

    Args:
        depth: Planar depths, object by object, nearest first within an object.
        density: Their densities.
        static: Columns of each static object and sky.
        players: Columns of each playable object.
    """
    kept = torch.ones_like(depth, dtype=torch.bool)
    for own in static:
        for other in players:
            last = min(own.stop - own.start, other.stop - other.start) - 1
            first, end = depth[:, other][:, :1], depth[:, other][:, last : last + 1]
            kept[:, own] &= (depth[:, own] < first) | (depth[:, own] >= end)
    return torch.where(kept, depth, 0.0), torch.where(kept, density, 0.0)
