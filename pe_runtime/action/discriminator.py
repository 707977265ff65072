"""Temporal discriminator D: does a sequence of states move like an encoded one?"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn
from torch.nn.utils.parametrizations import spectral_norm

from pe_runtime.action.movement import movements
from pe_runtime.action.sequences import StateSequence
from pe_runtime.config import ActionConfig
from pe_runtime.contract.errors import ConfigError

KERNELS = {"movements": 3, "states": 5}
"""Steps that a convolution reads at once, by what D judges."""


class TemporalDiscriminator(nn.Module):
    """D: 1D convolutions over time with spectral normalisation, mean over time, one logit.

    It sees poses and movements; where in the world an object stands, and how it looks, says nothing
    about how it moves. With the `discriminator` "states" it sees what the paper's authors showed
    theirs: positions, poses, and the actions and directions that A found.
    """

    def __init__(self, config: ActionConfig, pose_features: int) -> None:
        super().__init__()
        self.config = config
        of_states = config.discriminator == "states"
        seen = 3 + config.actions + config.variability if of_states else 2
        width, kernel = config.discriminator_width, KERNELS[config.discriminator]
        widths = [seen + pose_features, width, width, width]
        self.layers = nn.ModuleList(
            spectral_norm(nn.Conv1d(before, after, kernel, padding=kernel // 2))
            for before, after in zip(widths, widths[1:], strict=False)
        )
        self.score = spectral_norm(nn.Linear(width, 1))
        self.slope = 0.0 if of_states else 0.2
        # The authors' mean divides by one step more than there are.
        self.surplus = 1 if of_states else 0
        self.register_buffer("position_scale", torch.tensor(config.discriminator_scale), False)

    def forward(
        self,
        sequence: StateSequence,
        actions: Float[Tensor, "batch moves actions"] | None = None,
        directions: Float[Tensor, "batch moves variability"] | None = None,
        valid: Bool[Tensor, "batch time"] | None = None,
    ) -> Float[Tensor, " batch"]:
        """Logit of "encoded from pictures" against "made by the dynamics network".

        Args:
            sequence: States; a single one counts as standing still.
            actions: The actions drawn; only looked at (and needed) by a D of "states".
            directions: A's directions, drawn; likewise. No gradient goes back to either.
            valid: Steps that count; None for all.

        Raises:
            ConfigError: A D of "states" is given no actions or no directions.
        """
        if self.config.discriminator == "movements":
            columns = self._movements(sequence)
        else:
            columns = self._states(sequence, actions, directions)
        if valid is not None:
            columns = columns * valid[..., None].to(columns)
        return self.judge(columns, valid)

    def judge(
        self,
        columns: Float[Tensor, "batch time columns"],
        valid: Bool[Tensor, "batch time"] | None = None,
    ) -> Float[Tensor, " batch"]:
        """Logit of what D sees of sequences, already in columns; see `forward`."""
        hidden = columns.transpose(1, 2)
        for layer in self.layers:
            hidden = nn.functional.leaky_relu(layer(hidden), self.slope)
        if valid is None:
            steps = hidden.shape[-1]
            mean = hidden.mean(dim=-1) * (steps / (steps + self.surplus))
        else:
            count = valid.sum(dim=1) + self.surplus
            mean = (hidden * valid[:, None].to(hidden)).sum(dim=-1) / count[:, None].clamp_min(1)
        return self.score(mean).squeeze(-1)

    def _movements(self, sequence: StateSequence) -> Tensor:
        axes = sequence.axes(self.config.movement_frame)
        moves = movements(sequence.positions, axes) / self.config.movement_scale
        # The first state was not moved to; a zero keeps one column per state.
        moves = torch.cat([torch.zeros_like(sequence.positions[:, :1, :2]), moves], dim=1)
        return torch.cat([moves, sequence.poses], dim=-1)

    def _states(
        self, sequence: StateSequence, actions: Tensor | None, directions: Tensor | None
    ) -> Tensor:
        if actions is None or directions is None:
            raise ConfigError("a discriminator of states judges actions and directions too")
        taken = torch.cat([actions, directions], dim=-1).detach()
        # Nothing is done after the last state; its column repeats what led to it.
        last = taken[:, -1:] if taken.shape[1] else taken.new_zeros(len(taken), 1, taken.shape[2])
        taken = torch.cat([taken, last], dim=1)
        return torch.cat([sequence.positions / self.position_scale, sequence.poses, taken], dim=-1)
