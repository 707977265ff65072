"""Rays and objects of one frame, and one object's samples on the rays that meet it."""

from dataclasses import dataclass, field

import torch
from jaxtyping import Float, Int
from torch import Tensor

from pe_runtime.geometry.cameras import Cameras
from pe_runtime.rendering.folded_field import FoldedField


@dataclass(frozen=True)
class FrameRays:
    """Rays of one frame.

    Attributes:
        camera: The one camera.
        pixels: Where each ray passes through the picture.
        directions: World directions per metre of planar depth.
        lengths: Their lengths; float32.
        base: Planar depth from which depths of samples count, metres. From far away the differences
            are what has the digits. Always 0 under "release-2022".
    """

    camera: Cameras
    pixels: Float[Tensor, "rays 2"]
    directions: Float[Tensor, "rays 3"]
    lengths: Float[Tensor, " rays"]
    base: float = 0.0

    def __len__(self) -> int:
        """Number of rays."""
        return self.directions.shape[0]


@dataclass(frozen=True)
class FrameObject:
    """One visible object in one state.

    Attributes:
        field: Its field with style and pose folded in.
        position: Metres, environment space.
        heading: Radians about the world's z axis.
        visible: Whether it is drawn; a hidden one meets no ray.
    """

    field: FoldedField
    position: Float[Tensor, "3"]
    heading: float = 0.0
    visible: bool = True


@dataclass(frozen=True)
class FramePassage:
    """An object's samples on the rays that meet it.

    Attributes:
        object: Whose samples they are.
        rays: Which rays, in order.
        row_of: For every ray of the frame its row here, or -1.
        depth: Planar depths beyond `FrameRays.base`, nearest first.
        thickness: Optical thickness; under "release-2022" per metre of planar depth.
        slot: Row of each sample in `coordinates` and `hidden`; -1 where nothing was evaluated.
        coordinates: Where the field was, or would be, asked; float32.
        hidden: Hidden features there; None where the density did not need them.
        elsewhere: Planar depth of the object's samples on all other rays (empty space).
        known: Branch features that were asked for before, and which rows those are.
    """

    object: FrameObject
    rays: Int[Tensor, " hits"]
    row_of: Int[Tensor, " rays"]
    depth: Float[Tensor, "hits samples"]
    thickness: Float[Tensor, "hits samples"]
    slot: Int[Tensor, "hits samples"]
    coordinates: Float[Tensor, "rows dims"]
    hidden: Float[Tensor, "rows width"] | None
    elsewhere: float
    known: dict[str, Tensor] = field(default_factory=dict)

    @property
    def evaluated(self) -> int:
        """Samples at which the density was evaluated."""
        return 0 if self.hidden is None else self.coordinates.shape[0]

    def branch(self, slots: Int[Tensor, " samples"]) -> Float[Tensor, "samples head"]:
        """Branch features of samples, by their slots."""
        hidden = (
            self.object.field.hidden(self.coordinates[slots])
            if self.hidden is None
            else (self.hidden[slots])
        )
        return self.object.field.branch(hidden)

    def remembered(
        self, slots: Int[Tensor, " samples"]
    ) -> tuple[Float[Tensor, "samples head"], int]:
        """Branch features of samples; those asked for before are not evaluated again.

        Returns:
            The features, and how many samples were evaluated.
        """
        if not self.known:
            count, width = self.coordinates.shape[0], self.object.field.head_width
            self.known["features"] = self.coordinates.new_zeros(count, width)
            self.known["there"] = torch.zeros(count, dtype=torch.bool, device=slots.device)
        there = self.known["there"]
        missing = slots[~there[slots]]
        if missing.numel():
            self.known["features"][missing] = self.branch(missing)
            there[missing] = True
        return self.known["features"][slots], missing.shape[0]
