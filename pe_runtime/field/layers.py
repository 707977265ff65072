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
