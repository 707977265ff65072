"""Building blocks of the fields: positional encoding, style modulation, plain layer stacks."""

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn


class PositionalEncoding(nn.Module):
    """gamma(p) = (p, sin(2^k f p), cos(2^k f p)) for k = 0 .. octaves-1 (NeRF).

    Args:
        dimensions: Length of p.
        octaves: Number of frequencies.
        base_frequency: f, radians per unit of p.
    """

    def __init__(self, dimensions: int, octaves: int, base_frequency: float) -> None:
        super().__init__()
        frequencies = base_frequency * 2.0 ** torch.arange(octaves)
        self.register_buffer("frequencies", frequencies, persistent=False)
        self.dimensions = dimensions
        self.features = dimensions * (1 + 2 * octaves)

    def forward(self, points: Float[Tensor, "*batch dim"]) -> Float[Tensor, "*batch features"]:
        """Encode points; always in float32 or better, since high octaves need the digits."""
        angles = (points[..., None, :] * self.frequencies[:, None]).flatten(-2)
        return torch.cat([points, torch.sin(angles), torch.cos(angles)], dim=-1)


class Modulation(nn.Module):
    """Style modulation gamma(w) h + beta(w), with gamma and beta linear in w (paper, eq. 3)."""

    def __init__(self, style_features: int, features: int) -> None:
        super().__init__()
        self.scale = nn.Linear(style_features, features)
        self.shift = nn.Linear(style_features, features)
        nn.init.ones_(self.scale.bias)
        nn.init.zeros_(self.shift.bias)

    def forward(
        self, style: Float[Tensor, "frames style"]
    ) -> tuple[Float[Tensor, "frames features"], Float[Tensor, "frames features"]]:
        """Scale and shift of each frame."""
        return self.scale(style), self.shift(style)


class Concatenation(nn.Module):
    """The style beside the hidden features, W (h, w) + b: a shift U w of W_h h + b and no scale.

    Stands where a `Modulation` stands, for the paper's ablation (its direct style encoding).
    """

    def __init__(self, style_features: int, features: int) -> None:
        super().__init__()
        self.shift = nn.Linear(style_features, features, bias=False)

    def forward(
        self, style: Float[Tensor, "frames style"]
    ) -> tuple[Float[Tensor, "frames features"], Float[Tensor, "frames features"]]:
        """Scale (ones) and shift of each frame."""
        shift = self.shift(style)
        return torch.ones_like(shift), shift


class Unstyled(nn.Module):
    """No style: the scale is 1 and the shift 0 in every frame."""

    def __init__(self, features: int) -> None:
        super().__init__()
        self.features = features

    def forward(
        self, style: Float[Tensor, "frames style"]
    ) -> tuple[Float[Tensor, "frames features"], Float[Tensor, "frames features"]]:
        """Ones and zeros."""
        shape = (style.shape[0], self.features)
        return style.new_ones(shape), style.new_zeros(shape)


def build_modulation(design: str, style_features: int, features: int) -> nn.Module:
    """How a style enters a layer of so many features: by "modulation" or "concatenation", if any.

    Args:
        design: One of `config.objects.STYLE_INPUTS`.
        style_features: Length of w; 0 for none.
        features: Width of the layer.
    """
    if style_features == 0:
        return Unstyled(features)
    designs = {"modulation": Modulation, "concatenation": Concatenation}
    return designs[design](style_features, features)


def per_ray(
    values: Float[Tensor, "frames features"], frame: Int[Tensor, " rays"]
) -> Float[Tensor, "rays 1 features"]:
    """One row per ray, broadcast over its samples; a single frame is not copied."""
    if values.shape[0] == 1:
        return values[:, None].expand(frame.shape[0], 1, -1)
    return values[frame][:, None]


def stack(widths: list[int]) -> nn.ModuleList:
    """Linear layers from each width to the next, Kaiming-initialised for ReLU."""
    layers = nn.ModuleList()
    for narrow, wide in zip(widths[:-1], widths[1:], strict=True):
        layer = nn.Linear(narrow, wide)
        nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
        nn.init.zeros_(layer.bias)
        layers.append(layer)
    return layers
