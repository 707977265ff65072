"""Convolutions of the feature renderers: reflected borders, Kaiming initialisation."""

from torch import nn


def convolution(narrow: int, wide: int, kernel: int = 3) -> nn.Conv2d:
    """A convolution that keeps the size; borders are reflected."""
    layer = nn.Conv2d(narrow, wide, kernel, padding=kernel // 2, padding_mode="reflect")
    nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
    nn.init.zeros_(layer.bias)
    return layer
