"""Temporal discriminator D: does a sequence of states move like an encoded one?"""

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.utils.parametrizations import spectral_norm

from pe_runtime.action.movement import ground_axes, movements
from pe_runtime.action.sequences import StateSequence
from pe_runtime.config import ActionConfig

KERNEL = 3


class TemporalDiscriminator(nn.Module):
    """D: 1D convolutions over time with spectral normalisation, mean over time, one logit.

    It sees poses and movements; where in the world an object stands, and how it looks, says nothing
    about how it moves.
    """

    def __init__(self, config: ActionConfig, pose_features: int) -> None:
        super().__init__()
        self.config = config
        width = config.discriminator_width
        widths = [2 + pose_features, width, width, width]
        self.layers = nn.ModuleList(
            spectral_norm(nn.Conv1d(before, after, KERNEL, padding=KERNEL // 2))
            for before, after in zip(widths, widths[1:], strict=False)
        )
        self.score = spectral_norm(nn.Linear(width, 1))

    def forward(self, sequence: StateSequence) -> Float[Tensor, " batch"]:
        """Logit of "encoded from pictures" against "made by the dynamics network".

        Args:
            sequence: States; a single one counts as standing still.
        """
        axes = ground_axes(sequence.world_from_camera, self.config.movement_frame)
        moves = movements(sequence.positions, axes) / self.config.movement_scale
        # The first state was not moved to; a zero keeps one column per state.
        moves = torch.cat([torch.zeros_like(sequence.positions[:, :1, :2]), moves], dim=1)
        features = torch.cat([moves, sequence.poses], dim=-1).transpose(1, 2)
        for layer in self.layers:
            features = nn.functional.leaky_relu(layer(features), 0.2)
        return self.score(features.mean(dim=-1)).squeeze(-1)
