"""A full-size tennis model of the authors' shape with seeded weights: nothing to download.

The weights are white: all octaves count alike, so neighbouring samples have nothing in common. That
is the hardest case for whatever rounds or leaves out; trained fields are smoother.
"""

import math

import torch
from torch import Tensor

from pe_runtime.environment import PlayableEnvironment
from pe_runtime.interop.official_entries import official_config
from pe_runtime.networks import SynthesisNetworks

SEEDED_TENNIS = "seeded-tennis"
GAINS = (
    (".bending.output.", 0.05),
    ("_player.density.", 3.0),
    (".density.", 0.5),
    (".modulations.", 0.3),
    ("feature_renderer.picture.", 1.5),
    ("feature_renderer.", 1.0),
    ("", 1.25),
)
"""Part of a name and the size of what such layers give, relative to what they take; the first that
fits counts. Players and court come out solid, pictures in middle tones and full of contrast. With
larger gains eight white layers are chaotic: the rounding of float32 alone would show."""


def seeded_tennis(device: str = "cpu", seed: int = 0) -> PlayableEnvironment:
    """The authors' tennis model in size and shape; the same weights for the same seed."""
    config = official_config("tennis")
    networks = SynthesisNetworks(config)
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for name, parameter in sorted(networks.named_parameters()):
            parameter.copy_(_drawn(name, parameter, generator))
    return PlayableEnvironment(config, networks.to(device), {}, {"kind": "model"})


def _drawn(name: str, parameter: Tensor, generator: torch.Generator) -> Tensor:
    values = torch.randn(parameter.shape, generator=generator)
    if parameter.ndim < 2:
        return 0.1 * values + (1.0 if name.endswith(".scale.bias") else 0.0)
    gain = next(gain for part, gain in GAINS if part in name)
    return values * (gain / math.sqrt(parameter[0].numel()))
