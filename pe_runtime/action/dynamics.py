"""Dynamics network R: state, action and memory -> next state and memory."""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from pe_runtime.action.movement import ground_axes, moved
from pe_runtime.action.sequences import PlayerState
from pe_runtime.config import ActionConfig


@dataclass(frozen=True)
class Memory:
    """What R remembers; it goes in and comes out, nothing is kept in the module.

    Attributes:
        hidden: Output of each LSTM layer at the last step.
        cell: Its cell state.
    """

    hidden: Float[Tensor, "layers batch width"]
    cell: Float[Tensor, "layers batch width"]


@dataclass(frozen=True)
class Control:
    """What moves the objects in one step.

    Attributes:
        action: One-hot, or a mixture that sums to 1.
        variability: Variation v of the action; zero at inference.
        world_from_camera: Rotation of the camera at the start of the step.
    """

    action: Float[Tensor, "batch actions"]
    variability: Float[Tensor, "batch variability"]
    world_from_camera: Float[Tensor, "batch 3 3"]


@dataclass(frozen=True)
class Step:
    """One step of R: the next state, how it was reached, and the memory after it.

    Attributes:
        state: Next state.
        movement: (right, forward) metres in the movement frame.
        memory: To be given to the next step.
    """

    state: PlayerState
    movement: Float[Tensor, "batch 2"]
    memory: Memory


def choose_memory(where: Bool[Tensor, " batch"], first: Memory, second: Memory) -> Memory:
    """The first memory for the objects where it is true, the second for the others."""
    where = where[None, :, None]
    return Memory(
        torch.where(where, first.hidden, second.hidden), torch.where(where, first.cell, second.cell)
    )


class DynamicsNetwork(nn.Module):
    """R: LSTM layers, then heads for movement and pose.

    This is ours; `ActionConfig` turns each of the following into what the paper's authors did.
    A style is constant along a sequence: R hands it on and does not look at it, so changing an
    object's style never changes its path. (Seen, it would also tell the training sequences apart
    and invite R to learn them by heart.) With `predict_style` R reads and predicts it as well, as
    in the paper. Headings are handed on too, and are read with `sees_heading` and changed with
    `predict_heading` only.

    Everything it predicts comes from LSTM outputs, which lie in (-1, 1), or from the action, so
    however long a rollout is, movement and pose stay bounded. Positions enter through tanh for the
    same reason, unless `bounded_positions` is off: far outside the trained area they say "far" and
    no more.
    """

    def __init__(self, config: ActionConfig, style_features: int, pose_features: int) -> None:
        super().__init__()
        self.config = config
        width, layers = config.dynamics_width, config.dynamics_layers
        seen = pose_features + (style_features if config.predict_style else 0)
        seen += 2 if config.sees_heading else 0
        features = 3 + seen + config.actions + config.variability
        widths = [features] + [width] * (layers - 1)
        self.cells = nn.ModuleList(nn.LSTMCell(each, width) for each in widths)
        self.initial_hidden = nn.Parameter(torch.zeros(layers, width))
        self.initial_cell = nn.Parameter(torch.zeros(layers, width))
        self.hidden = nn.Linear(width, width)
        self.movement = nn.Linear(width, 2)
        self.direct_movement = nn.Linear(config.actions, 2, bias=False)
        self.pose = nn.Linear(width, pose_features)
        self.style = nn.Linear(width, style_features) if config.predict_style else None
        # Sine and cosine of the angle by which the object turns.
        self.turn = nn.Linear(width, 2) if config.predict_heading else None
        self.register_buffer("position_scale", torch.tensor(config.position_scale), False)

    def initial_memory(self, batch: int) -> Memory:
        """The memory before the first step (learnt)."""
        shape = (-1, batch, -1)
        return Memory(
            self.initial_hidden[:, None].expand(shape), self.initial_cell[:, None].expand(shape)
        )

    def forward(self, state: PlayerState, control: Control, memory: Memory) -> Step:
        """Predict the next state.

        Args:
            state: Current states.
            control: Action, variability and camera.
            memory: From the step before, or `initial_memory`.
        """
        features = torch.cat([*self._seen(state), control.action, control.variability], dim=-1)
        hidden, memory = self._remember(features, memory)
        movement = self.movement(hidden) + self.direct_movement(control.action)
        movement = self.config.movement_scale * movement
        axes = ground_axes(control.world_from_camera, self.config.movement_frame, state.facing)
        position = moved(state.position, movement, axes)
        style = state.style if self.style is None else self.style(hidden)
        heading = state.heading
        if self.turn is not None:
            sine, cosine = self.turn(hidden).unbind(dim=-1)
            heading = _within_half_a_turn(state.facing + torch.atan2(sine, cosine))
        return Step(PlayerState(position, style, self.pose(hidden), heading), movement, memory)

    def _seen(self, state: PlayerState) -> list[Tensor]:
        """What R looks at in a state, in the order of its input."""
        position = state.position / self.position_scale
        seen = [torch.tanh(position) if self.config.bounded_positions else position]
        if self.config.sees_heading:
            seen.append(torch.stack([state.facing.sin(), state.facing.cos()], dim=-1))
        if self.config.predict_style:
            seen.append(state.style)
        return [*seen, state.pose]

    def _remember(self, features: Tensor, memory: Memory) -> tuple[Tensor, Memory]:
        hidden, cell = [], []
        for layer, each in enumerate(self.cells):
            features, state = each(features, (memory.hidden[layer], memory.cell[layer]))
            hidden.append(features)
            cell.append(state)
        features = torch.relu(self.hidden(features))
        return features, Memory(torch.stack(hidden), torch.stack(cell))


def _within_half_a_turn(angle: Float[Tensor, " batch"]) -> Float[Tensor, " batch"]:
    """The same direction between -pi and pi; angles that add up for ever would lose their digits.

    Not by subtracting turns: 2 pi is no float32 number, and the difference would add up too.
    """
    return torch.where(angle.abs() > math.pi, torch.atan2(angle.sin(), angle.cos()), angle)
