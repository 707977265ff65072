"""Action network A: which discrete action, and which variation of it, lies between two states."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pe_runtime.action.movement import ground_axes, movements
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
        mean: Mean of the variability embedding v.
        log_variance: Its log-variance.
    """

    logits: Float[Tensor, "batch moves actions"]
    mean: Float[Tensor, "batch moves variability"]
    log_variance: Float[Tensor, "batch moves variability"]

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

    def forward(self, sequence: StateSequence) -> ActionEstimate:
        """Estimate the action of each transition.

        Args:
            sequence: Encoded or reconstructed states.

        Returns:
            One estimate fewer than there are states; none for a single state.
        """
        axes = ground_axes(sequence.world_from_camera, self.config.movement_frame)
        moves = movements(sequence.positions, axes) / self.config.movement_scale
        if moves.shape[1] == 0:
            return self._nothing(moves)
        moves = moves.clamp(-LARGEST_MOVE, LARGEST_MOVE)
        before, after = sequence.poses[:, :-1], sequence.poses[:, 1:]
        moves = self._pad(moves.transpose(1, 2))
        poses = self._pad(torch.cat([after, after - before], dim=-1).transpose(1, 2))
        hidden = torch.relu(self.first(torch.cat([moves, poses], dim=1)))
        hidden = torch.relu(self.second(hidden))
        return ActionEstimate(
            (self.logits(hidden) + self.direct(moves)).transpose(1, 2),
            self.mean(hidden).transpose(1, 2),
            self.log_variance(hidden).clamp(-10.0, 10.0).transpose(1, 2),
        )

    def _pad(self, series: Tensor) -> Tensor:
        margin = self.config.window // 2
        return nn.functional.pad(series, (margin, margin), mode="replicate")

    def _nothing(self, moves: Tensor) -> ActionEstimate:
        batch = moves.shape[0]
        variability = moves.new_zeros(batch, 0, self.config.variability)
        logits = moves.new_zeros(batch, 0, self.config.actions)
        return ActionEstimate(logits, variability, variability)


def sample_actions(
    logits: Float[Tensor, "*batch actions"], temperature: float, generator: torch.Generator
) -> Float[Tensor, "*batch actions"]:
    """Draw one action per row by the hard Gumbel-softmax.

    The result is one-hot; its gradient is that of softmax((logits + g) / temperature), with g from
    the Gumbel distribution (straight-through estimator).

    Args:
        logits: Unnormalised log-probabilities.
        temperature: Above 0; lower is closer to the true gradient and noisier.
        generator: Where the noise comes from (a generator of the CPU).
    """
    uniform = torch.rand(logits.shape, generator=generator).to(logits)
    tiny = torch.finfo(logits.dtype).tiny
    # 1 - u instead of u would allow log(0) at the other end; both ends are clamped.
    noise = -torch.log(-torch.log(uniform.clamp(tiny, 1.0 - 1e-7)))
    soft = torch.softmax((logits + noise) / temperature, dim=-1)
    hard = torch.zeros_like(soft).scatter(-1, soft.argmax(dim=-1, keepdim=True), 1.0)
    return hard + soft - soft.detach()


def sample_variability(
    estimate: ActionEstimate, generator: torch.Generator
) -> Float[Tensor, "batch moves variability"]:
    """Draw v from its estimated normal distribution (reparametrised)."""
    noise = torch.randn(estimate.mean.shape, generator=generator).to(estimate.mean)
    return estimate.mean + noise * torch.exp(0.5 * estimate.log_variance)
