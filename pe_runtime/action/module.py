"""The action module of one playable class: A and R together (paper, Sec. 3.2)."""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from pe_runtime.action.action_network import ActionEstimate, ActionNetwork
from pe_runtime.action.dynamics import Control, DynamicsNetwork, Memory, Step
from pe_runtime.action.sampling import Sampling, sample_actions
from pe_runtime.action.sequences import PlayerState, StateSequence, stack_states
from pe_runtime.action.state_action_network import StateActionNetwork
from pe_runtime.config import ActionConfig


@dataclass(frozen=True)
class Reconstruction:
    """A sequence rebuilt from its first state and its inferred actions.

    Attributes:
        estimate: What A says about the encoded sequence.
        actions: The sampled actions, one-hot unless drawn softly.
        variability: The v of each.
        sequence: R's states; the first is the encoded one.
        moves: R's movements, (right, forward) metres.
        memory: R's memory after the last step.
    """

    estimate: ActionEstimate
    actions: Float[Tensor, "batch moves actions"]
    variability: Float[Tensor, "batch moves variability"]
    sequence: StateSequence
    moves: Float[Tensor, "batch moves 2"]
    memory: Memory


class ActionModule(nn.Module):
    """Discovers discrete actions in state sequences and plays them back."""

    def __init__(self, config: ActionConfig, style_features: int, pose_features: int) -> None:
        super().__init__()
        self.config = config
        if config.design == "state":
            self.action_network = StateActionNetwork(config)
        else:
            self.action_network = ActionNetwork(config, pose_features)
        self.dynamics = DynamicsNetwork(config, style_features, pose_features)

    def infer(self, sequence: StateSequence) -> Int[Tensor, "batch moves"]:
        """The most probable action of each transition."""
        return self.action_network(sequence).logits.argmax(dim=-1)

    def step(
        self,
        state: PlayerState,
        actions: Int[Tensor, " batch"],
        world_from_camera: Float[Tensor, "batch 3 3"],
        memory: Memory | None = None,
    ) -> Step:
        """Apply one action to each state, without variability (inference).

        Args:
            state: Current states.
            actions: Index of the action of each.
            world_from_camera: Rotation of the camera at the start of the step.
            memory: From the step before; None at the first.
        """
        memory = memory or self.dynamics.initial_memory(actions.shape[0])
        action = nn.functional.one_hot(actions, self.config.actions).to(state.position)
        variability = action.new_zeros(action.shape[0], self.config.variability)
        return self.dynamics(state, Control(action, variability, world_from_camera), memory)

    def play(
        self,
        first: PlayerState,
        actions: Int[Tensor, "batch moves"],
        world_from_camera: Float[Tensor, "batch time 3 3"],
    ) -> StateSequence:
        """Roll out a sequence of actions from one state (inference).

        Args:
            first: States at the first step.
            actions: Index of the action of each transition.
            world_from_camera: Camera rotations, one more than there are actions.
        """
        states, memory = [first], None
        for t in range(actions.shape[1]):
            step = self.step(states[-1], actions[:, t], world_from_camera[:, t], memory)
            states.append(step.state)
            memory = step.memory
        return stack_states(states, world_from_camera)

    def go_on(
        self,
        first: PlayerState,
        actions: Float[Tensor, "batch moves actions"],
        world_from_camera: Float[Tensor, "batch time 3 3"],
        memory: Memory,
    ) -> StateSequence:
        """Roll out drawn actions, without variability, from where R is (training).

        Args:
            first: States at the first step.
            actions: One-hot.
            world_from_camera: Camera rotations, one more than there are actions.
            memory: R's, at the first step.
        """
        states = [first]
        none = actions.new_zeros(actions.shape[0], self.config.variability)
        for t in range(actions.shape[1]):
            control = Control(actions[:, t], none, world_from_camera[:, t])
            step = self.dynamics(states[-1], control, memory)
            states.append(step.state)
            memory = step.memory
        return stack_states(states, world_from_camera)

    def reconstruct(
        self, sequence: StateSequence, sampling: Sampling, memory: Memory | None = None
    ) -> Reconstruction:
        """Infer the actions of a sequence and rebuild it from them (training).

        Args:
            sequence: Encoded states.
            sampling: Temperature, teacher forcing, noise. With its `centroid_rate`, the centroids
                of a "state" A change; nothing else in the module does.
            memory: What R remembers from before; None for a fresh start.
        """
        estimate = self.action_network(sequence, sampling.noise)
        actions = sample_actions(estimate.logits, sampling)
        variability = self.action_network.variability(estimate, actions, sampling)
        batch, count = actions.shape[:2]
        with_v = sampling.noise.uniform(batch, 1, 1) < sampling.variability
        variability = variability * with_v.to(variability)
        forced = sampling.noise.uniform(batch, count) < sampling.teacher_forcing
        forced[:, : sampling.given] = True
        forced = forced.to(actions.device)
        states, moves = [sequence.at(0)], []
        memory = memory or self.dynamics.initial_memory(batch)
        for t in range(count):
            start = _choose(forced[:, t], sequence.at(t), states[-1])
            camera = sequence.world_from_camera[:, t]
            step = self.dynamics(start, Control(actions[:, t], variability[:, t], camera), memory)
            states.append(step.state)
            moves.append(step.movement)
            memory = step.memory
        rebuilt = stack_states(states, sequence.world_from_camera)
        moves = torch.stack(moves, dim=1) if moves else actions.new_zeros(batch, 0, 2)
        return Reconstruction(estimate, actions, variability, rebuilt, moves, memory)


def _choose(where: Tensor, first: PlayerState, second: PlayerState) -> PlayerState:
    where = where[:, None]
    turned = first.heading is not None or second.heading is not None
    return PlayerState(
        torch.where(where, first.position, second.position),
        torch.where(where, first.style, second.style),
        torch.where(where, first.pose, second.pose),
        torch.where(where[:, 0], first.facing, second.facing) if turned else None,
    )
