"""The authors' decoder in our feature renderer of design "paper".

Their modules are numbered within sequences: blocks first, then padding or upsampling, a
convolution, its batch normalisation. A ReLU after every block (their v7, Minecraft) moves the later
numbers. The tables below are all there is to know about it.
"""

from collections.abc import Mapping

from torch import Tensor

from pe_runtime.config import FeatureRendererConfig
from pe_runtime.interop.folding import batch_statistics, folded_linear

Shapes = dict[str, tuple[int, ...]]

# Ours -> convolution and batch normalisation of theirs, below `autoencoder_model.decoder.`.
BLOCKS = {False: (0, 1, 2), True: (0, 2, 4)}
"""Numbers of the residual blocks in each `upsample_blocks.L`, without and with ReLUs."""

RISES = {
    False: {"rises.0": (0, 4), "outputs.0": (1, 4), "outputs.1": (1, 8)},
    True: {"rises.0": (0, 7), "outputs.0": (1, 7), "outputs.1": (1, 11)},
}
"""Level and number of each convolution after a doubling; its normalisation is the next number."""


def renderer_layers(config: FeatureRendererConfig) -> dict[str, tuple[str, str, tuple[int, ...]]]:
    """Ours -> their convolution, its batch normalisation, and the weight's shape."""
    layers = {}
    coarse, fine = config.widths[1], config.widths[0]
    levels = ((config.features[1], coarse), (fine + config.features[0], fine))
    for level, (entering, width) in enumerate(levels):
        for index, number in enumerate(BLOCKS[config.activated_blocks]):
            theirs, ours = f"upsample_blocks.{level}.{number}", f"blocks.{level}.{index}"
            narrow = width if index else entering
            first, second = (width, narrow, 3, 3), (width, width, 3, 3)
            layers[f"{ours}.first"] = (*_pair(f"{theirs}.conv_block", 1), first)
            layers[f"{ours}.second"] = (*_pair(f"{theirs}.conv_block", 5), second)
            if narrow != width:
                shape = (width, narrow, 1, 1)
                pair = _pair(f"{theirs}.residual_connection_convolution", 0)
                layers[f"{ours}.shortcut"] = (*pair, shape)
    widths = {
        "rises.0": (fine, coarse),
        "outputs.0": (config.output_widths[0], fine),
        "outputs.1": (config.output_widths[1], config.output_widths[0]),
    }
    for ours, (level, number) in RISES[config.activated_blocks].items():
        shape = (*widths[ours], 3, 3)
        layers[ours] = (*_pair(f"upsample_blocks.{level}", number), shape)
    return layers


def _pair(parent: str, number: int) -> tuple[str, str]:
    return f"{parent}.{number}", f"{parent}.{number + 1}"


def renderer_entries(config: FeatureRendererConfig) -> Shapes:
    """Their names and shapes, below `autoencoder_model.decoder.`."""
    entries: Shapes = {}
    for convolution, normalisation, shape in renderer_layers(config).values():
        entries[f"{convolution}.weight"] = shape
        entries |= batch_statistics(normalisation, shape[0], affine=True)
    last = (3, config.output_widths[-1], 7, 7)
    return entries | {"final_convolutions.1.weight": last, "final_convolutions.1.bias": (3,)}


def convert_renderer(
    theirs: Mapping[str, Tensor], config: FeatureRendererConfig
) -> dict[str, Tensor]:
    """Weights of our feature renderer from theirs; our names, float64.

    Args:
        theirs: The entries of `renderer_entries`.
        config: F in our terms.
    """
    ours = {}
    for name, (convolution, normalisation, _) in renderer_layers(config).items():
        weight = theirs[f"{convolution}.weight"]
        weight, bias = folded_linear(weight, None, theirs, normalisation)
        ours |= {f"{name}.weight": weight, f"{name}.bias": bias}
    for part in ("weight", "bias"):
        ours[f"picture.{part}"] = theirs[f"final_convolutions.1.{part}"]
    return ours
