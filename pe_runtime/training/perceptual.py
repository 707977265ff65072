"""Perceptual distances between pictures.

The paper compares VGG features. Where no such weights are at hand, fixed random filters at four
scales stand in: they see edges and texture, and they are honest about not being VGG.
"""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pe_runtime.config import SynthesisConfig
from pe_runtime.contract.errors import ConfigError
from pe_runtime.vgg import VggFeatures, load_vgg


class VggDistance(nn.Module):
    """Mean absolute difference of VGG features, summed over the layers (Johnson et al.).

    Args:
        features: The network and its layers.
    """

    def __init__(self, features: VggFeatures) -> None:
        super().__init__()
        self.features = features

    def forward(
        self,
        images: Float[Tensor, "frames 3 height width"],
        targets: Float[Tensor, "frames 3 height width"],
    ) -> Float[Tensor, ""]:
        """Distance of pictures in [0, 1]; no gradient flows into the targets."""
        with torch.no_grad():
            wanted = self.features(targets)
        pairs = zip(self.features(images), wanted, strict=True)
        return torch.stack([(mine - theirs).abs().mean() for mine, theirs in pairs]).sum()


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


def build_perceptual(config: SynthesisConfig, smallest: int) -> RandomFeatures | VggDistance:
    """The distance that a training asks for.

    Args:
        config: Its `perceptual` and `perceptual_weights`.
        smallest: Height or width of the smallest pictures that will be compared, pixels.

    Raises:
        CheckpointError: The file of weights is missing or holds something else.
        ConfigError: It is another VGG than asked for, or sees nothing in pictures as small.
    """
    if config.perceptual == "random":
        return RandomFeatures()
    features = load_vgg(config.perceptual_weights)
    if config.perceptual not in ("vgg", features.design):
        raise ConfigError(
            f"synthesis.perceptual is {config.perceptual!r}, but {config.perceptual_weights} is a "
            f"{features.design}"
        )
    if smallest < features.smallest:
        raise ConfigError(
            f"{features.design} compares pictures of {features.smallest} pixels or more; patches "
            f"leave {smallest} (synthesis.patch_height, patch_width)"
        )
    return VggDistance(features)
