"""Encoded sequences in memory: what the action module is trained on."""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from pe_runtime.action.sequences import StateSequence
from pe_runtime.contract.errors import EpisodeError


@dataclass(frozen=True)
class ActionDataset:
    """Every encoded sequence of every object of one playable class.

    Attributes:
        positions: From the boxes, metres, world.
        styles: One code per sequence (the mean over its frames).
        poses: Deformation codes.
        world_from_camera: Camera rotations.
        true_actions: Actions that were really taken, where a recorder knows them; only logged.
        headings: Radians about the world's z axis; None where objects keep the world's axes.
    """

    positions: Float[Tensor, "sequences time 3"]
    styles: Float[Tensor, "sequences style"]
    poses: Float[Tensor, "sequences time pose"]
    world_from_camera: Float[Tensor, "sequences time 3 3"]
    true_actions: Int[Tensor, "sequences moves"] | None = None
    headings: Float[Tensor, "sequences time"] | None = None

    def __post_init__(self) -> None:
        for name in ("positions", "styles", "poses", "world_from_camera", "headings"):
            values = getattr(self, name)
            if values is not None and not torch.isfinite(values).all():
                raise EpisodeError(
                    f"the encoded {name} hold NaN or infinity; leave out the sequences in which"
                    " an object has no box"
                )

    def __len__(self) -> int:
        return self.positions.shape[0]

    @property
    def steps(self) -> int:
        """States in each sequence."""
        return self.positions.shape[1]

    def sequences(self) -> StateSequence:
        """All of them, whole."""
        styles = self.styles[:, None].expand(-1, self.steps, -1)
        return StateSequence(
            self.positions, styles, self.poses, self.world_from_camera, self.headings
        )

    def first(self, count: int) -> "ActionDataset":
        """The first so many of the sequences, or all."""
        return self.pick(torch.arange(len(self), device=self.positions.device) < count)

    def pick(self, keep: Bool[Tensor, " sequences"]) -> "ActionDataset":
        """The sequences for which `keep` is true."""
        true = self.true_actions
        return ActionDataset(
            self.positions[keep],
            self.styles[keep],
            self.poses[keep],
            self.world_from_camera[keep],
            None if true is None else true[keep.to(true.device)],
            None if self.headings is None else self.headings[keep],
        )

    def sample(self, generator: torch.Generator, batch: int, steps: int) -> StateSequence:
        """Draw windows of equal length, each from a random sequence at a random start.

        Args:
            generator: Of the CPU.
            batch: How many windows.
            steps: States in each; cut to the sequences' length.
        """
        steps = min(steps, self.steps)
        which = torch.randint(len(self), (batch, 1), generator=generator)
        start = torch.randint(self.steps - steps + 1, (batch, 1), generator=generator)
        which = which.to(self.positions.device)
        when = (start + torch.arange(steps)).to(self.positions.device)
        return StateSequence(
            self.positions[which, when],
            self.styles[which].expand(-1, steps, -1),
            self.poses[which, when],
            self.world_from_camera[which, when],
            None if self.headings is None else self.headings[which, when],
        )


def without_jumps(data: ActionDataset, longest: float) -> ActionDataset:
    """Leave out sequences in which an object moves further than `longest` metres in one step.

    Such jumps come from boxes that show only a part: behind another object, or at the rim.
    """
    steps = (data.positions[:, 1:] - data.positions[:, :-1]).norm(dim=-1)
    return data.pick((steps <= longest).all(dim=1))


def join(datasets: list[ActionDataset]) -> ActionDataset:
    """Put the sequences of several objects of one class together.

    Raises:
        EpisodeError: There is none, or their lengths or code sizes differ.
    """
    if not datasets:
        raise EpisodeError("there are no sequences to learn actions from")
    shapes = {(d.steps, d.styles.shape[1], d.poses.shape[2]) for d in datasets}
    if len(shapes) > 1:
        raise EpisodeError(
            f"sequences must agree in (steps, style size, pose size); found {sorted(shapes)}"
        )
    known = [each.true_actions for each in datasets]
    turned = [each.headings for each in datasets]
    return ActionDataset(
        torch.cat([each.positions for each in datasets]),
        torch.cat([each.styles for each in datasets]),
        torch.cat([each.poses for each in datasets]),
        torch.cat([each.world_from_camera for each in datasets]),
        None if any(each is None for each in known) else torch.cat(known),
        None if any(each is None for each in turned) else torch.cat(turned),
    )
