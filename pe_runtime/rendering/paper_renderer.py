"""Feature renderer F as the paper's authors built it: design "paper" of the configuration."""

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pe_runtime.config import FeatureRendererConfig
from pe_runtime.rendering.convolutions import convolution


class PaperBlock(nn.Module):
    """shortcut(h) + conv(relu(conv(h))), with a 1x1 shortcut where the width changes.

    Args:
        narrow: Channels in.
        wide: Channels out.
        activated: Whether a ReLU follows the sum.
    """

    def __init__(self, narrow: int, wide: int, activated: bool) -> None:
        super().__init__()
        self.first = convolution(narrow, wide)
        self.second = convolution(wide, wide)
        nn.init.zeros_(self.second.weight)
        self.shortcut = convolution(narrow, wide, 1) if narrow != wide else None
        self.activated = activated

    def forward(
        self, hidden: Float[Tensor, "frames channels height width"]
    ) -> Float[Tensor, "frames wide height width"]:
        """Refine a feature map."""
        straight = hidden if self.shortcut is None else self.shortcut(hidden)
        refined = straight + self.second(torch.relu(self.first(hidden)))
        return torch.relu(refined) if self.activated else refined


class PaperFeatureRenderer(nn.Module):
    """ConvNet F: residual blocks at each map's resolution, a convolution after each doubling.

    Batch normalisation, which the authors have after every convolution, is part of the weights: at
    inference it is a scale and a shift per channel.

    Args:
        config: Strides, channels and widths, finest first.
    """

    def __init__(self, config: FeatureRendererConfig) -> None:
        super().__init__()
        self.config = config
        self.blocks, self.rises = nn.ModuleList(), nn.ModuleList()
        before = 0
        for features, width in reversed(list(zip(config.features, config.widths, strict=True))):
            if before:
                self.rises.append(convolution(before, width))
            entering = features + (width if before else 0)
            widths = [entering] + [width] * config.blocks
            self.blocks.append(
                nn.Sequential(
                    *[
                        PaperBlock(a, b, config.activated_blocks)
                        for a, b in zip(widths, widths[1:], strict=False)
                    ]
                )
            )
            before = width
        self.outputs = nn.ModuleList()
        for width in config.output_widths:
            self.outputs.append(convolution(before, width))
            before = width
        self.picture = convolution(before, 3, 7)

    def forward(
        self, maps: list[Float[Tensor, "frames _ _ _"]]
    ) -> Float[Tensor, "frames 3 height width"]:
        """Decode feature maps, finest first, into sRGB pictures in [0, 1].

        Args:
            maps: One map per stride; each half as high and wide as the one before.
        """
        hidden = self.blocks[0](maps[-1])
        finer = reversed(maps[:-1])
        for rise, blocks, each in zip(self.rises, self.blocks[1:], finer, strict=True):
            hidden = blocks(torch.cat([_risen(rise, hidden), each], dim=1))
        for rise in self.outputs:
            hidden = _risen(rise, hidden)
        return torch.sigmoid(self.picture(hidden).float())


def _risen(rise: nn.Module, hidden: Tensor) -> Tensor:
    # Corner pixels stay corner pixels, unlike in our own design: the authors' weights expect it.
    doubled = nn.functional.interpolate(hidden, scale_factor=2, mode="bilinear", align_corners=True)
    return torch.relu(rise(doubled))
