"""Knobs of the synthesis module's training, and of rendering."""

import types
from collections.abc import Mapping
from dataclasses import dataclass

from pe_runtime.config.checks import demand


@dataclass(frozen=True)
class SynthesisConfig:
    """Training of encoder, fields and feature renderer (paper, Sec. 3.3)."""

    steps: int = 8000
    sequences: int = 4
    frames: int = 2
    patch_height: int = 80
    patch_width: int = 64
    player_patches: float = 0.7
    """Share of patches centred on a playable object; the rest fall anywhere."""
    learning_rate: float = 2e-3
    renderer_learning_rate: float = 1e-3
    warmup: int = 100
    clip: float = 1.0
    perceptual_weight: float = 0.3
    gradient_weight: float = 0.03
    permute_style: bool = True
    recoloured: float = 0.0
    """Share of sequences that are shown in other colours (`training.augmentation`)."""
    density_noise: float = 0.0
    bfloat16: bool = True
    seed: int = 0
    evaluate_every: int = 500
    checkpoint_every: int = 250

    def __post_init__(self) -> None:
        counts = (self.sequences, self.frames, self.checkpoint_every)
        demand(min(counts) >= 1, "synthesis: sequences, frames, checkpoint_every >= 1")
        smallest = min(self.patch_height, self.patch_width)
        demand(smallest >= 16, f"synthesis: patches of 16 pixels or more, not {smallest}")


@dataclass(frozen=True)
class Quality:
    """What one render quality leaves out, beyond what can be skipped without changing a pixel."""

    weight_threshold: float = 0.0
    """Samples with less weight than this get no features."""
    sample_share: float = 1.0
    """Share of the class's samples that are drawn per ray."""
    bfloat16: bool = False
    """Products in bfloat16 with float32 sums, where the processor multiplies them faster."""
    occupancy: bool = False
    """Players are asked only where a coarse look at this very frame found something."""
    termination: float = 0.0
    """Samples that less light than this reaches are not evaluated."""

    def __post_init__(self) -> None:
        shares = (self.weight_threshold, self.termination)
        demand(0 <= min(shares) <= max(shares) < 1, "quality: thresholds from 0 to below 1")
        demand(0 < self.sample_share <= 1, "quality: sample_share above 0, up to 1")


QUALITIES: Mapping[str, Quality] = types.MappingProxyType(
    {
        "exact": Quality(),
        "balanced": Quality(1e-3, bfloat16=True, occupancy=True, termination=1e-3),
        "draft": Quality(2e-3, sample_share=0.5, bfloat16=True, occupancy=True, termination=1e-2),
    }
)
