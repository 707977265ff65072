"""Encoder of the heading: by how much an object is turned against the camera."""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pe_runtime.config import EncoderConfig
from pe_runtime.perception.object_encoder import build_trunk, with_view

START = 0.01
"""Largest initial weight of the head: headings start near the camera's."""


class HeadingEncoder(nn.Module):
    """A residual trunk and a head that points into a direction of the plane.

    The plane is bounded by tanh; the authors scale it by 1.4, which no angle shows.
    """

    def __init__(self, encoder: EncoderConfig) -> None:
        super().__init__()
        self.trunk = build_trunk(encoder)
        self.direction = nn.Linear(self.trunk.features, 2)
        # Near the plane's origin, where a plain start would be, the angle's gradients explode.
        nn.init.uniform_(self.direction.weight, -START, START)
        with torch.no_grad():
            self.direction.bias.copy_(torch.tensor([1.0, 0.0]))

    def forward(
        self, crops: Float[Tensor, "crops 3 height width"], view: Float[Tensor, "crops view"]
    ) -> Float[Tensor, " crops"]:
        """Angle between the camera's heading and the object's, radians, of crops in [0, 1]."""
        points = torch.tanh(self.direction(self.trunk(with_view(crops, view))).float())
        return torch.atan2(points[:, 1], points[:, 0])
