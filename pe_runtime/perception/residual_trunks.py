"""Residual trunks of the authors' release: a picture -> one feature vector.

Their batch normalisations stand only behind linear layers, so on import they are folded into the
convolutions (`interop/encoder_weights.py`); here are none. Weights for training from scratch start
so that signals keep their size without them.
"""

import math
from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import avg_pool2d, leaky_relu

SLOPE = 0.2
"""Of the leaky ReLUs, for negative inputs."""


class ResidualBlock(nn.Module):
    """Two 3x3 convolutions, the first also shrinking, beside a shortcut.

    Args:
        narrow: Channels that come in.
        wide: Channels that go out.
        shrink: Pixels along each axis that become one.
        share: Of the branch in the sum at the start of training; falls with the trunk's depth.
        activated: Whether a leaky ReLU follows the sum.
    """

    def __init__(
        self, narrow: int, wide: int, shrink: int, share: float, activated: bool = True
    ) -> None:
        super().__init__()
        self.shrink, self.activated = shrink, activated
        self.first = nn.Conv2d(narrow, wide, 3, padding=1)
        self.second = nn.Conv2d(wide, wide, 3, padding=1)
        changes = shrink != 1 or narrow != wide
        self.shortcut = nn.Conv2d(narrow, wide, 1) if changes else None
        _start(self.first)
        _start(self.second, share)
        if self.shortcut is not None:
            _start(self.shortcut)

    def forward(
        self, inputs: Float[Tensor, "crops narrow height width"]
    ) -> Float[Tensor, "crops wide rows columns"]:
        """Rows and columns shrink by the block's factor, rounded down."""
        branch = self.second(leaky_relu(self._smaller(self.first(inputs)), SLOPE))
        kept = inputs if self.shortcut is None else self._smaller(self.shortcut(inputs))
        total = branch + kept
        return leaky_relu(total, SLOPE) if self.activated else total

    def _smaller(self, maps: Tensor) -> Tensor:
        return avg_pool2d(maps, self.shrink) if self.shrink > 1 else maps


class ResidualTrunk(nn.Module):
    """A small ResNet (their v5): 7x7 stem, then two blocks for each width.

    Args:
        inputs: Channels of the picture.
        channels: Widths; the picture is halved by the stem and before every width.
    """

    def __init__(self, inputs: int, channels: Sequence[int]) -> None:
        super().__init__()
        self.stem = nn.Conv2d(inputs, channels[0], 7, stride=2, padding=3)
        _start(self.stem)
        share = 1 / math.sqrt(2 * len(channels))
        self.blocks = _pairs(channels[0], channels, share)
        self.features = channels[-1]

    def forward(
        self, pictures: Float[Tensor, "crops inputs height width"]
    ) -> Float[Tensor, "crops features"]:
        """Mean over the picture of the last maps."""
        maps = leaky_relu(self.stem(pictures), SLOPE)
        return self.blocks(maps).mean(dim=(-2, -1))


class AttentiveTrunk(nn.Module):
    """A slim trunk that first chooses where to look (their v4): a learnt mask on early maps.

    Args:
        inputs: Channels of the picture.
        channels: Widths: of the stem, then of two blocks each; the picture is halved for each.
    """

    def __init__(self, inputs: int, channels: Sequence[int]) -> None:
        super().__init__()
        first = channels[0]
        self.stem = nn.Conv2d(inputs, first, 3, padding=1)
        _start(self.stem)
        share = 1 / math.sqrt(2 * len(channels) - 1)
        self.attention = ResidualBlock(first, first + 1, 1, share, activated=False)
        self.blocks = _pairs(first, channels[1:], share)
        self.features = channels[-1]

    def forward(
        self, pictures: Float[Tensor, "crops inputs height width"]
    ) -> Float[Tensor, "crops features"]:
        """Mean over the picture of the last maps."""
        maps = leaky_relu(avg_pool2d(self.stem(pictures), 2), SLOPE)
        maps = self.attention(maps)
        mask = torch.sigmoid(maps[:, -1:])
        return self.blocks(leaky_relu(maps[:, :-1], SLOPE) * mask).mean(dim=(-2, -1))


def _pairs(narrow: int, channels: Sequence[int], share: float) -> nn.Sequential:
    blocks: list[nn.Module] = []
    for wide in channels:
        blocks += [ResidualBlock(narrow, wide, 2, share), ResidualBlock(wide, wide, 1, share)]
        narrow = wide
    return nn.Sequential(*blocks)


def _start(layer: nn.Conv2d, share: float = 1.0) -> None:
    """Initial weights that keep the variance through a leaky ReLU, times a share."""
    nn.init.kaiming_normal_(layer.weight, a=SLOPE, nonlinearity="leaky_relu")
    with torch.no_grad():
        layer.weight.mul_(share)
    nn.init.zeros_(layer.bias)
