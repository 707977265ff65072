"""States of one playable class over time: what the action module reads and predicts."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor


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

    def at(self, step: int) -> PlayerState:
        """The states at one step."""
        return PlayerState(self.positions[:, step], self.styles[:, step], self.poses[:, step])

    def detach(self) -> "StateSequence":
        """The same numbers without their history of gradients."""
        return StateSequence(
            self.positions.detach(),
            self.styles.detach(),
            self.poses.detach(),
            self.world_from_camera,
        )


def stack_states(
    states: list[PlayerState], world_from_camera: Float[Tensor, "batch time 3 3"]
) -> StateSequence:
    """Join the states of successive steps to one sequence."""
    return StateSequence(
        torch.stack([each.position for each in states], dim=1),
        torch.stack([each.style for each in states], dim=1),
        torch.stack([each.pose for each in states], dim=1),
        world_from_camera,
    )
