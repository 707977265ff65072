"""Perceptual-style distance between pictures that needs no download.

The paper compares VGG features. Where no such weights are at hand, fixed random filters at four
scales stand in: they see edges and texture, and they are honest about not being VGG.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn


class RandomFeatures(nn.Module):
    """Mean absolute difference of fixed random convolution features.

    Args:
        widths: Channels of the successive half-resolution layers.
        seed: Seed of the filters; the same seed is the same distance on every machine.
    """

    def __init__(self, widths: tuple[int, ...] = (16, 32, 48), seed: int = 7) -> None:
        super().__init__()
        generator = torch.Generator().manual_seed(seed)
        self.count = len(widths)
        narrow = 3
        for index, wide in enumerate(widths):
            filters = torch.randn(wide, narrow, 3, 3, generator=generator)
            # Without a mean, filters answer to structure and not to brightness.
            filters = filters - filters.mean(dim=(2, 3), keepdim=True)
            filters = filters / filters.flatten(1).norm(dim=1)[:, None, None, None]
            self.register_buffer(f"filters{index}", filters, persistent=False)
            narrow = wide

    def forward(
        self,
        images: Float[Tensor, "frames 3 height width"],
        targets: Float[Tensor, "frames 3 height width"],
    ) -> Float[Tensor, ""]:
        """Distance of pictures in [0, 1]; no gradient flows into the targets."""
        distance = images.new_zeros(())
        with torch.no_grad():
            wanted = self._features(targets)
        for mine, theirs in zip(self._features(images), wanted, strict=True):
            distance = distance + (mine - theirs).abs().mean()
        return distance / self.count

    def _features(self, images: Tensor) -> list[Tensor]:
        features, hidden = [], images
        for index in range(self.count):
            filters = getattr(self, f"filters{index}")
            hidden = torch.relu(nn.functional.conv2d(hidden, filters, padding=1))
            features.append(hidden)
            hidden = nn.functional.avg_pool2d(hidden, 2)
        return features


def gradient_distance(
    images: Float[Tensor, "frames 3 height width"], targets: Float[Tensor, "frames 3 height width"]
) -> Float[Tensor, ""]:
    """Mean absolute difference of horizontal and vertical picture gradients."""
    across = (images.diff(dim=-1) - targets.diff(dim=-1)).abs().mean()
    down = (images.diff(dim=-2) - targets.diff(dim=-2)).abs().mean()
    return across + down
