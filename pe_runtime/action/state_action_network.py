"""Action network A as the paper's authors built it: a point per state, a direction per action."""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pe_runtime.action.action_network import ActionEstimate
from pe_runtime.action.sampling import Noise, Sampling
from pe_runtime.action.sequences import StateSequence
from pe_runtime.config import ActionConfig

SMALLEST = 1e-12
"""An action with less probability than this in a whole batch leaves its centroid where it is."""

LARGEST_SPREAD = 20.0
"""Log-variances of states are cut to so much; those of scenes as they are seen lie within +-10."""


class StateActionNetwork(nn.Module):
    """A: a perceptron that embeds each state as a normal distribution.

    The action of a transition is read off its direction in the embedding, the difference of the two
    states' points; so it has their difference as its mean and the sum of their variances. v is how
    far the direction is from the centroid of the actions taken. Only position and heading are
    looked at.
    """

    def __init__(self, config: ActionConfig) -> None:
        super().__init__()
        self.config = config
        features = 5 if config.sees_heading else 3
        self.first = nn.Linear(features, config.hidden)
        self.second = nn.Linear(config.hidden, config.hidden)
        self.third = nn.Linear(config.hidden, config.hidden)
        self.mean = nn.Linear(config.hidden, config.variability)
        self.log_variance = nn.Linear(config.hidden, config.variability)
        self.logits = nn.Linear(config.variability, config.actions)
        self.register_buffer("centroids", torch.randn(config.actions, config.variability))
        self.register_buffer("position_scale", torch.tensor(config.position_scale), False)

    def forward(self, sequence: StateSequence, noise: Noise | None = None) -> ActionEstimate:
        """Estimate the action of each transition.

        Args:
            sequence: Encoded or reconstructed states.
            noise: Directions are drawn with it; without, they are their means.

        Returns:
            One estimate fewer than there are states; none for a single state.
        """
        hidden = sequence.positions / self.position_scale
        if self.config.sees_heading:
            turned = [sequence.facings.sin(), sequence.facings.cos()]
            hidden = torch.cat([hidden, torch.stack(turned, dim=-1)], dim=-1)
        for layer in (self.first, self.second, self.third):
            hidden = torch.relu(layer(hidden))
        points = self.mean(hidden)
        # A foot near the horizon is found kilometres away, where the variance would be infinite.
        spreads = self.log_variance(hidden).clamp(-LARGEST_SPREAD, LARGEST_SPREAD)
        mean = points[:, 1:] - points[:, :-1]
        log_variance = torch.logaddexp(spreads[:, 1:], spreads[:, :-1])
        direction = mean
        if noise is not None:
            direction = mean + noise.normal(mean) * torch.exp(0.5 * log_variance)
        return ActionEstimate(self.logits(direction), mean, log_variance, direction)

    def variability(
        self, estimate: ActionEstimate, actions: Tensor, sampling: Sampling
    ) -> Float[Tensor, "batch moves variability"]:
        """How each direction differs from its actions' centroids, v = sum_k a_k (d - c_k).

        Args:
            estimate: From `forward`.
            actions: The actions taken, (batch moves actions); rows sum to 1.
            sampling: With a `centroid_rate`, the centroids first follow this batch.
        """
        if sampling.centroid_rate > 0:
            self.centroids = followed_centroids(
                self.centroids,
                estimate.probabilities.flatten(0, 1),
                estimate.mean.flatten(0, 1),
                sampling.centroid_rate,
            )
        away = estimate.direction[..., None, :] - self.centroids
        return (actions[..., None] * away).sum(dim=-2)


@torch.no_grad()
def followed_centroids(
    centroids: Float[Tensor, "actions variability"],
    probabilities: Float[Tensor, "samples actions"],
    directions: Float[Tensor, "samples variability"],
    rate: float,
) -> Float[Tensor, "actions variability"]:
    """Move each action's centroid towards the mean direction of the samples that are likely it.

        c_k <- (1 - rate) c_k + rate sum_n p_nk d_n / sum_n p_nk

    An action that no sample is likely to be keeps its centroid.

    Args:
        centroids: c.
        probabilities: p, rows that sum to 1.
        directions: d, the means of the directions.
        rate: In [0, 1].
    """
    mass = probabilities.sum(dim=0)[:, None]
    seen = probabilities.T @ directions / mass.clamp_min(SMALLEST)
    followed = (1.0 - rate) * centroids + rate * seen
    return torch.where(mass > SMALLEST, followed, centroids)
