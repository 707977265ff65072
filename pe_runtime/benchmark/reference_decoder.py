"""Feature renderer F in float64, both designs, written from the names in a model file."""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import conv2d, interpolate, pad

from pe_runtime.benchmark.reference_field import Weights, relu
from pe_runtime.config import FeatureRendererConfig


def decode(
    maps: Sequence[Float[Tensor, "1 _ _ _"]], weights: Weights, config: FeatureRendererConfig
) -> Float[Tensor, "3 height width"]:
    """Feature maps, finest first, to an sRGB picture in [0, 1].

    Args:
        maps: One per stride, float64.
        weights: Tensors below `synthesis.feature_renderer.`, float64.
        config: F's design and sizes.
    """
    designs = {"light": _light, "paper": _paper, "direct": _direct}
    return torch.sigmoid(designs[config.design](maps, weights, config))[0]


def _direct(maps: Sequence[Tensor], weights: Weights, config: FeatureRendererConfig) -> Tensor:
    return maps[0]


def _light(maps: Sequence[Tensor], weights: Weights, config: FeatureRendererConfig) -> Tensor:
    hidden = None
    for level, entering in enumerate(reversed(maps)):
        if hidden is not None:
            entering = torch.cat([entering, _doubled(hidden)], dim=1)
        hidden = _convolve(weights, f"inputs.{level}", entering)
        for block in range(config.blocks):
            name = f"blocks.{level}.{block}"
            inner = relu(_convolve(weights, f"{name}.first", relu(hidden)))
            hidden = hidden + _convolve(weights, f"{name}.second", inner)
    coarse = maps[0][:, :3]
    for number in range(len(config.output_widths)):
        hidden = _convolve(weights, f"outputs.{number}", _doubled(relu(hidden)))
        coarse = _doubled(coarse)
    return _convolve(weights, "picture", relu(hidden)) + coarse


def _paper(maps: Sequence[Tensor], weights: Weights, config: FeatureRendererConfig) -> Tensor:
    hidden = _paper_blocks(maps[-1], weights, 0, config)
    for level, finer in enumerate(reversed(maps[:-1]), start=1):
        risen = relu(_convolve(weights, f"rises.{level - 1}", _doubled(hidden, corners=True)))
        hidden = _paper_blocks(torch.cat([risen, finer], dim=1), weights, level, config)
    for number in range(len(config.output_widths)):
        hidden = relu(_convolve(weights, f"outputs.{number}", _doubled(hidden, corners=True)))
    return _convolve(weights, "picture", hidden)


def _paper_blocks(
    hidden: Tensor, weights: Weights, level: int, config: FeatureRendererConfig
) -> Tensor:
    for block in range(config.blocks):
        name = f"blocks.{level}.{block}"
        widens = f"{name}.shortcut.weight" in weights
        straight = _convolve(weights, f"{name}.shortcut", hidden) if widens else hidden
        inner = relu(_convolve(weights, f"{name}.first", hidden))
        hidden = straight + _convolve(weights, f"{name}.second", inner)
        hidden = relu(hidden) if config.activated_blocks else hidden
    return hidden


def _convolve(weights: Weights, name: str, hidden: Tensor) -> Tensor:
    """A convolution that keeps the size, with reflected borders."""
    kernel = weights[f"{name}.weight"]
    border = kernel.shape[-1] // 2
    return conv2d(pad(hidden, (border,) * 4, mode="reflect"), kernel, weights[f"{name}.bias"])


def _doubled(hidden: Tensor, corners: bool = False) -> Tensor:
    return interpolate(hidden, scale_factor=2, mode="bilinear", align_corners=corners)
