"""Rays and objects of one frame, and one object's samples on the rays that meet it."""

from collections.abc import Callable
from dataclasses import dataclass, field

import torch
from jaxtyping import Float, Int
from torch import Tensor

from pe_runtime.geometry.cameras import Cameras
from pe_runtime.rendering.folded_field import FoldedField
from pe_runtime.rendering.regions import Region


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
        parts: Which cells of each feature map they belong to; empty for all of them.
    """

    camera: Cameras
    pixels: Float[Tensor, "rays 2"]
    directions: Float[Tensor, "rays 3"]
    lengths: Float[Tensor, " rays"]
    base: float = 0.0
    parts: tuple[Region, ...] = ()

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
        hidden: Hidden features there; None for opaque surfaces, whose density needs none.
        elsewhere: Planar depth of the object's samples on all other rays (empty space).
        known: Features that were asked for before, by what they are, and where they are known.
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
    known: dict[str, tuple[Tensor, Tensor]] = field(default_factory=dict)

    @property
    def is_surface(self) -> bool:
        """Whether it is opaque: one sample a ray, whose density nobody needs to ask for."""
        return self.hidden is None

    @property
    def evaluated(self) -> int:
        """Samples at which the density was evaluated."""
        return 0 if self.hidden is None else self.coordinates.shape[0]

    def branch(
        self, slots: Int[Tensor, " samples"], remember: bool
    ) -> tuple[Float[Tensor, "samples head"], int]:
        """Branch features of samples.

        Args:
            slots: The samples.
            remember: Keep what is evaluated, and do not evaluate again what was kept.

        Returns:
            The features, the caller's own, and how many samples were evaluated.
        """
        if not remember:
            return self._branch(slots), slots.shape[0]
        return self._recalled("branch", slots, self._branch)

    def shown(
        self, rows: Int[Tensor, " rows"], channels: slice, remember: bool
    ) -> tuple[Float[Tensor, "rows channels"], int]:
        """What an opaque surface shows on its rays.

        Args:
            rows: Which of its rays.
            channels: Of the feature map to which those rays belong.
            remember: As for `branch`.

        Returns:
            As `branch`.
        """

        def evaluate(rows: Tensor) -> Tensor:
            branch = self._branch(rows)
            return self.object.field.last_layer(branch, branch.new_ones(len(branch)), channels)

        if not remember:
            return evaluate(rows), rows.shape[0]
        return self._recalled(f"{channels.start}:{channels.stop}", rows, evaluate)

    def _branch(self, slots: Tensor) -> Tensor:
        field = self.object.field
        if self.hidden is None:
            return field.branch(field.hidden(self.coordinates[slots]))
        return field.branch(self.hidden[slots])

    def _recalled(
        self, what: str, slots: Tensor, evaluate: Callable[[Tensor], Tensor]
    ) -> tuple[Tensor, int]:
        """Features by slot, evaluated where they are not known yet, and how many were."""
        if what not in self.known:
            found = evaluate(slots)
            features = found.new_empty(self.coordinates.shape[0], found.shape[1])
            there = torch.zeros(len(features), dtype=torch.bool, device=slots.device)
            features[slots], there[slots] = found, True
            self.known[what] = features, there
            return found, slots.shape[0]
        features, there = self.known[what]
        missing = slots[~there[slots]]
        if missing.numel():
            features[missing], there[missing] = evaluate(missing), True
        return features[slots], missing.shape[0]
