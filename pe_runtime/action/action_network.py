"""Action network A: which discrete action, and which variation of it, lies between two states."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pe_runtime.action.movement import movements
from pe_runtime.action.sampling import Noise, Sampling
from pe_runtime.action.sequences import StateSequence
from pe_runtime.config import ActionConfig
from pe_runtime.contract.errors import ConfigError

LARGEST_MOVE = 4.0
"""Movements enter A cut to so many `movement_scale`: a box that was cut for one frame throws the
foot point metres away, and the window would spread that over its neighbours."""


@dataclass(frozen=True)
class ActionEstimate:
    """What A says about each transition from one state to the next.

    Attributes:
        logits: Unnormalised log-probabilities of the actions.
        mean: Mean of the embedding that v is made of.
        log_variance: Its log-variance.
        direction: The embedding as it was drawn, where drawing it is part of A; else its mean.
    """

    logits: Float[Tensor, "batch moves actions"]
    mean: Float[Tensor, "batch moves variability"]
    log_variance: Float[Tensor, "batch moves variability"]
    direction: Float[Tensor, "batch moves variability"]

    @property
    def probabilities(self) -> Float[Tensor, "batch moves actions"]:
        """Probability of each action."""
        return torch.softmax(self.logits, dim=-1)


class ActionNetwork(nn.Module):
    """A: a perceptron over the movement and the two poses of each transition.

    The paper gives A the two whole states. Position and style are left out here: they differ
    little within a sequence, and an A that sees them can raise the mutual information by naming
    places or clothes instead of actions. With a `window` above 1 the first layer also reads the
    neighbouring transitions (edges repeat), which averages the jitter of box-derived positions.
    """

    def __init__(self, config: ActionConfig, pose_features: int) -> None:
        super().__init__()
        if config.window < 1 or config.window % 2 == 0:
            raise ConfigError(f"action.window must be odd and positive, found {config.window}")
        self.config = config
        features = 2 + 2 * pose_features
        self.first = nn.Conv1d(features, config.hidden, config.window)
        self.second = nn.Conv1d(config.hidden, config.hidden, 1)
        self.logits = nn.Conv1d(config.hidden, config.actions, 1)
        # Straight from movement to action: a sum over directions is easier found here than
        # through the pose-dominated hidden layers (reference trial: labels form much sooner).
        self.direct = nn.Conv1d(2, config.actions, config.window, bias=False)
        self.mean = nn.Conv1d(config.hidden, config.variability, 1)
        self.log_variance = nn.Conv1d(config.hidden, config.variability, 1)

    def forward(self, sequence: StateSequence, noise: Noise | None = None) -> ActionEstimate:
        """Estimate the action of each transition.

        Args:
            sequence: Encoded or reconstructed states.
            noise: Not used; this A draws nothing before it names an action.

        Returns:
            One estimate fewer than there are states; none for a single state.
        """
        axes = sequence.axes(self.config.movement_frame)
        moves = movements(sequence.positions, axes) / self.config.movement_scale
        if moves.shape[1] == 0:
            return self._nothing(moves)
        moves = moves.clamp(-LARGEST_MOVE, LARGEST_MOVE)
        before, after = sequence.poses[:, :-1], sequence.poses[:, 1:]
        moves = self._pad(moves.transpose(1, 2))
        poses = self._pad(torch.cat([after, after - before], dim=-1).transpose(1, 2))
        hidden = torch.relu(self.first(torch.cat([moves, poses], dim=1)))
        hidden = torch.relu(self.second(hidden))
        logits = (self.logits(hidden) + self.direct(moves)).transpose(1, 2)
        mean = self.mean(hidden).transpose(1, 2)
        log_variance = self.log_variance(hidden).clamp(-10.0, 10.0).transpose(1, 2)
        return ActionEstimate(logits, mean, log_variance, mean)

    def variability(
        self, estimate: ActionEstimate, actions: Tensor, sampling: Sampling
    ) -> Float[Tensor, "batch moves variability"]:
        """Draw v from its estimated normal distribution (reparametrised).

        Args:
            estimate: From `forward`.
            actions: Not used; this A says directly how an action was varied.
            sampling: Where the noise comes from.
        """
        noise = sampling.noise.normal(estimate.mean)
        return estimate.mean + noise * torch.exp(0.5 * estimate.log_variance)

    def _pad(self, series: Tensor) -> Tensor:
        margin = self.config.window // 2
        return nn.functional.pad(series, (margin, margin), mode="replicate")

    def _nothing(self, moves: Tensor) -> ActionEstimate:
        batch = moves.shape[0]
        variability = moves.new_zeros(batch, 0, self.config.variability)
        logits = moves.new_zeros(batch, 0, self.config.actions)
        return ActionEstimate(logits, variability, variability, variability)
