"""Feature field V of one object class: points -> density and style-modulated features."""

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from pe_runtime.config import ObjectClassConfig
from pe_runtime.field.bending import RayBending
from pe_runtime.field.layers import PositionalEncoding, build_modulation, per_ray, stack

DENSITY_SHIFT = 2.5
"""Raw densities start around 0; the shift makes volumes start as thin fog, not as solid blocks."""

LARGEST = 1e30
"""Density per metre beyond which nothing gets denser: products with it stay finite."""


class ObjectField(nn.Module):
    """V with its optional ray bending B.

    Evaluation comes in three steps, so that the renderer can do each only where it is needed:
    `trunk` (geometry, every sample), `branch` (appearance, samples that carry weight) and
    `features` (the last linear layer, once per ray after integration, which commutes with it).

    Args:
        config: The class's volume, samples and widths.
        features: Channels of all feature maps together.
    """

    def __init__(self, config: ObjectClassConfig, features: int) -> None:
        super().__init__()
        self.config = config
        field = config.field
        low, high = torch.tensor(config.low), torch.tensor(config.high)
        self.register_buffer("middle", (low + high) / 2, persistent=False)
        self.register_buffer("extent", (high - low) / 2, persistent=False)
        # A sky that sees the camera's place has it behind the three numbers of the direction.
        self.entering = [*config.axes, *((3, 4, 5) if config.sees_origin else ())]
        entering = len(self.entering)
        self.encoding = PositionalEncoding(entering, field.octaves, field.base_frequency)
        self.layers = stack([self.encoding.features, *[field.width] * field.depth])
        if field.skip:
            self.skip = nn.Linear(self.encoding.features, field.width, bias=False)
        self.bending = None
        if config.bending is not None:
            self.bending = RayBending(config.bending, config.pose_features)
        self.density = None if config.opaque else nn.Linear(field.width, 1)
        widths = [field.head_width, field.branch_width or field.head_width]
        self.head = stack([field.width, *widths])
        self.modulations = nn.ModuleList(
            build_modulation(config.style_input, config.style_features, width) for width in widths
        )
        self.output = nn.Linear(widths[-1], features)

    def coordinates(self, points: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3"]:
        """Object-frame points (metres) in half box sizes around the volume's middle."""
        return (points - self.middle) / self.extent

    def trunk(
        self,
        coordinates: Float[Tensor, "rays samples coordinates"],
        frame: Int[Tensor, " rays"],
        pose: Float[Tensor, "frames pose"],
    ) -> Float[Tensor, "rays samples width"]:
        """Hidden features of sample points, after bending.

        Args:
            coordinates: Positions in half box sizes; for a sky, unit ray directions, and with
                `sees_origin` the camera's place in box sizes.
            frame: Frame of each ray.
            pose: Pose codes of the frames; ignored by classes that do not bend.
        """
        if self.bending is not None:
            coordinates = self.bending(coordinates, frame, pose)
        encoded = self.encoding(coordinates[..., self.entering])
        hidden = torch.relu(self.layers[0](encoded))
        for index, layer in enumerate(self.layers[1:], start=1):
            hidden = layer(hidden)
            if index == self.config.field.skip:
                hidden = hidden + self.skip(encoded)
            hidden = torch.relu(hidden)
        return hidden

    def densities(
        self, hidden: Float[Tensor, "rays samples width"], noise: float = 0.0
    ) -> Float[Tensor, "rays samples"]:
        """Density sigma >= 0 per metre, softplus (or ReLU) of the trunk's output.

        Args:
            hidden: Output of `trunk`.
            noise: Standard deviation of noise on the raw density (training only).
        """
        raw = self.density(hidden)[..., 0].float()
        if noise > 0:
            raw = raw + noise * torch.randn_like(raw)
        return self.density_of(raw)

    def density_of(self, raw: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
        """Density per metre of raw outputs."""
        if self.config.field.density == "relu":
            density = torch.relu(raw)
        else:
            density = nn.functional.softplus(raw - DENSITY_SHIFT)
        return (density * self.config.field.density_scale).clamp(max=LARGEST)

    def branch(
        self,
        hidden: Float[Tensor, "rays samples width"],
        frame: Int[Tensor, " rays"],
        style: Float[Tensor, "frames style"],
    ) -> Float[Tensor, "rays samples head"]:
        """Feature branch up to its last linear layer, modulated by the style (paper, eq. 3)."""
        for layer, modulation in zip(self.head, self.modulations, strict=True):
            hidden = self._modulated(hidden, frame, layer, modulation(style))
        return hidden

    def features(
        self,
        integrated: Float[Tensor, "rays head"],
        opacity: Float[Tensor, " rays"],
        channels: slice,
    ) -> Float[Tensor, "rays channels"]:
        """Last linear layer on integrated features: sum w (W h + b) = W sum(w h) + b sum(w)."""
        weight, bias = self.output.weight[channels], self.output.bias[channels]
        return nn.functional.linear(integrated, weight) + bias * opacity[:, None]

    def _modulated(
        self,
        hidden: Tensor,
        frame: Tensor,
        layer: nn.Linear,
        scale_and_shift: tuple[Tensor, Tensor],
    ) -> Tensor:
        scale, shift = scale_and_shift
        if scale.shape[0] == 1:
            # One frame: fold the style into the layer, gamma (W h + b) + beta.
            weight = layer.weight * scale[0][:, None]
            return torch.relu(
                nn.functional.linear(hidden, weight, layer.bias * scale[0] + shift[0])
            )
        return torch.relu(layer(hidden) * per_ray(scale, frame) + per_ray(shift, frame))
