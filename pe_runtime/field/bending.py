"""Ray bending B: where a point of the posed object lies in canonical space (paper, eq. 2)."""

import math

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from pe_runtime.config import BendingConfig
from pe_runtime.field.layers import PositionalEncoding, per_ray, stack


class RayBending(nn.Module):
    """Displacement B(x, pi) of sample points, x~ = x + B(x, pi).

    The pose enters the first layer as a bias, so it costs one product per frame and not per sample.

    Args:
        config: Widths and octaves.
        pose_features: Length of pi.
    """

    def __init__(self, config: BendingConfig, pose_features: int) -> None:
        super().__init__()
        self.encoding = PositionalEncoding(3, config.octaves, config.base_frequency)
        self.layers = stack([self.encoding.features, *[config.width] * config.depth])
        self.pose = nn.Linear(pose_features, config.width, bias=False)
        nn.init.normal_(self.pose.weight, std=1 / math.sqrt(max(pose_features, 1)))
        self.skip = config.skip
        if config.skip:
            self.skip_encoding = nn.Linear(self.encoding.features, config.width, bias=False)
            self.skip_pose = nn.Linear(pose_features, config.width, bias=False)
        self.output = nn.Linear(config.width, 3)
        # Near zero starves the pose of gradient, and much more scrambles the space at the start.
        nn.init.normal_(self.output.weight, std=config.output_scale)
        nn.init.zeros_(self.output.bias)

    def forward(
        self,
        points: Float[Tensor, "rays samples 3"],
        frame: Int[Tensor, " rays"],
        pose: Float[Tensor, "frames pose"],
    ) -> Float[Tensor, "rays samples 3"]:
        """Bend sample points.

        Args:
            points: Positions in half box sizes, within [-1, 1].
            frame: Frame of each ray.
            pose: Pose code pi of each frame.

        Returns:
            Canonical positions, kept inside the volume.
        """
        encoded = self.encoding(points)
        hidden = self.layers[0](encoded) + per_ray(self.pose(pose), frame)
        for index, layer in enumerate(self.layers[1:], start=1):
            hidden = layer(torch.relu(hidden))
            if index == self.skip:
                again = per_ray(self.skip_pose(pose), frame)
                hidden = hidden + self.skip_encoding(encoded) + again
        return (points + self.output(torch.relu(hidden)).float()).clamp(-1.0, 1.0)
