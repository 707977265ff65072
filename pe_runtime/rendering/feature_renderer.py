"""Feature renderer F: feature maps at several resolutions -> image (paper, Sec. 3.1)."""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pe_runtime.config import FeatureRendererConfig
from pe_runtime.rendering.convolutions import convolution
from pe_runtime.rendering.paper_renderer import PaperFeatureRenderer


def build_feature_renderer(config: FeatureRendererConfig) -> nn.Module:
    """F in the design that the configuration asks for; all take maps and give pictures."""
    designs = {
        "light": FeatureRenderer,
        "paper": PaperFeatureRenderer,
        "direct": DirectRenderer,
    }
    return designs[config.design](config)


class Residual(nn.Module):
    """h + conv(relu(conv(relu(h)))), with reflected borders."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.first = convolution(width, width)
        self.second = convolution(width, width)
        nn.init.zeros_(self.second.weight)

    def forward(
        self, hidden: Float[Tensor, "frames channels height width"]
    ) -> Float[Tensor, "frames channels height width"]:
        """Refine a feature map."""
        return hidden + self.second(torch.relu(self.first(torch.relu(hidden))))


class FeatureRenderer(nn.Module):
    """ConvNet F: starts at the coarsest map, takes the finer ones in on its way up.

    The first three channels of the finest map are also a coarse picture (logits) of their own, to
    which the ConvNet adds; so colours are right early and the ConvNet learns what rays cannot.

    Args:
        config: Strides, channels and widths, finest first.
    """

    def __init__(self, config: FeatureRendererConfig) -> None:
        super().__init__()
        self.config = config
        self.inputs = nn.ModuleList()
        self.blocks = nn.ModuleList()
        coarser = 0
        for features, width in reversed(list(zip(config.features, config.widths, strict=True))):
            self.inputs.append(convolution(features + coarser, width))
            self.blocks.append(nn.Sequential(*[Residual(width) for _ in range(config.blocks)]))
            coarser = width
        self.outputs = nn.ModuleList()
        for width in config.output_widths:
            self.outputs.append(convolution(coarser, width))
            coarser = width
        self.picture = convolution(coarser, 3)
        nn.init.zeros_(self.picture.weight)

    def forward(
        self, maps: list[Float[Tensor, "frames _ _ _"]]
    ) -> Float[Tensor, "frames 3 height width"]:
        """Decode feature maps, finest first, into sRGB pictures in [0, 1].

        Args:
            maps: One map per stride; each half as high and wide as the one before.
        """
        hidden = None
        for index, each in enumerate(reversed(maps)):
            if hidden is not None:
                each = torch.cat([each, _doubled(hidden)], dim=1)
            hidden = self.blocks[index](self.inputs[index](each))
        coarse = maps[0][:, :3]
        for layer in self.outputs:
            hidden = layer(_doubled(torch.relu(hidden)))
            coarse = _doubled(coarse)
        logits = self.picture(torch.relu(hidden)).float() + coarse.float()
        return torch.sigmoid(logits)


class DirectRenderer(nn.Module):
    """No ConvNet: the three integrated features of a pixel's ray are its colour (logits).

    For the paper's ablation of F.

    Args:
        config: Strides and channels; one map of stride 1 and three channels.
    """

    def __init__(self, config: FeatureRendererConfig) -> None:
        super().__init__()
        self.config = config

    def forward(
        self, maps: list[Float[Tensor, "frames 3 height width"]]
    ) -> Float[Tensor, "frames 3 height width"]:
        """Squash the map into sRGB pictures in [0, 1]."""
        return torch.sigmoid(maps[0].float())


def _doubled(hidden: Tensor) -> Tensor:
    return nn.functional.interpolate(hidden, scale_factor=2, mode="bilinear", align_corners=False)
