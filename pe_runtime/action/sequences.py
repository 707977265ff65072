"""States of one playable class over time: what the action module reads and predicts."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from pe_runtime.action.movement import ground_axes


@dataclass(frozen=True)
class PlayerState:
    """States of several objects of one class at one step: s = (x, w, pi).

    Attributes:
        position: Metres, world; z is the height above the ground and is never predicted.
        style: Appearance code w.
        pose: Deformation code pi.
        heading: Radians about the world's z axis; None where objects keep the world's axes.
    """

    position: Float[Tensor, "batch 3"]
    style: Float[Tensor, "batch style"]
    pose: Float[Tensor, "batch pose"]
    heading: Float[Tensor, " batch"] | None = None

    @property
    def facing(self) -> Float[Tensor, " batch"]:
        """The heading, 0 where objects keep the world's axes."""
        return torch.zeros_like(self.position[:, 0]) if self.heading is None else self.heading


@dataclass(frozen=True)
class StateSequence:
    """States at successive steps and the cameras that saw them; one object per batch entry.

    Attributes:
        positions: Metres, world.
        styles: Appearance codes.
        poses: Deformation codes.
        world_from_camera: Rotations of the cameras (OpenCV axes).
        headings: Radians about the world's z axis; None where objects keep the world's axes.
    """

    positions: Float[Tensor, "batch time 3"]
    styles: Float[Tensor, "batch time style"]
    poses: Float[Tensor, "batch time pose"]
    world_from_camera: Float[Tensor, "batch time 3 3"]
    headings: Float[Tensor, "batch time"] | None = None

    @property
    def facings(self) -> Float[Tensor, "batch time"]:
        """The headings, 0 where objects keep the world's axes."""
        return torch.zeros_like(self.positions[..., 0]) if self.headings is None else self.headings

    def axes(self, frame: str) -> Float[Tensor, "batch time 2 2"]:
        """What "right" and "forward" mean at every step; see `ground_axes`."""
        return ground_axes(self.world_from_camera, frame, self.facings)

    def at(self, step: int) -> PlayerState:
        """The states at one step."""
        return PlayerState(
            self.positions[:, step],
            self.styles[:, step],
            self.poses[:, step],
            None if self.headings is None else self.headings[:, step],
        )

    def detach(self) -> "StateSequence":
        """The same numbers without their history of gradients."""
        return StateSequence(
            self.positions.detach(),
            self.styles.detach(),
            self.poses.detach(),
            self.world_from_camera,
            None if self.headings is None else self.headings.detach(),
        )


def stack_states(
    states: list[PlayerState], world_from_camera: Float[Tensor, "batch time 3 3"]
) -> StateSequence:
    """Join the states of successive steps to one sequence."""
    turned = any(each.heading is not None for each in states)
    return StateSequence(
        torch.stack([each.position for each in states], dim=1),
        torch.stack([each.style for each in states], dim=1),
        torch.stack([each.pose for each in states], dim=1),
        world_from_camera,
        torch.stack([each.facing for each in states], dim=1) if turned else None,
    )
