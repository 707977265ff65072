"""A feature renderer as a list of steps, ready to draw whole pictures or parts of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import nn

from pe_runtime.config import FeatureRendererConfig
from pe_runtime.rendering.feature_renderer import DirectRenderer, FeatureRenderer
from pe_runtime.rendering.gathering import Source
from pe_runtime.rendering.packed_convolution import PackedConvolution, packed
from pe_runtime.rendering.paper_renderer import PaperFeatureRenderer

TOGETHER = 4
"""Pixels of a row that the last convolution, with its three channels, computes at once."""


@dataclass(frozen=True)
class Step:
    """One value more out of earlier ones.

    Attributes:
        sources: What it sees, side by side.
        convolution: What it does to that; None where it is only doubled, or squashed.
        plus: Index of a value to add; of more channels than needed, the first count.
        after: What comes last: "relu", "sigmoid" or nothing.
    """

    sources: tuple[Source, ...]
    convolution: PackedConvolution | None = None
    plus: int | None = None
    after: str | None = None


@dataclass(frozen=True)
class PreparedRenderer:
    """F with fixed weights.

    Values are the maps, finest first, then one per step; the last is the picture.

    Attributes:
        config: Of F.
        steps: In order.
        dtype: In which convolutions are computed.
    """

    config: FeatureRendererConfig
    steps: tuple[Step, ...]
    dtype: torch.dtype

    @property
    def same_in_parts(self) -> bool:
        """Whether parts of a picture have the bits that they have in the whole."""
        return all(each.convolution.packed is not None for each in self.steps if each.convolution)


def prepared(renderer: nn.Module, dtype: torch.dtype = torch.float32) -> PreparedRenderer:
    """A copy of a feature renderer's weights in the order in which they run fastest.

    Args:
        renderer: F in either design. Later changes of its weights do not reach the copy.
        dtype: In which to compute; float32, or bfloat16 with sums in float32.
    """
    designs = {FeatureRenderer: _light, PaperFeatureRenderer: _paper, DirectRenderer: _direct}
    writer = _Writer(len(renderer.config.strides), dtype)
    with torch.inference_mode():
        designs[type(renderer)](renderer, writer)
    return PreparedRenderer(renderer.config, tuple(writer.steps), dtype)


class _Writer:
    """Collects steps and counts values."""

    def __init__(self, maps: int, dtype: torch.dtype) -> None:
        self.maps, self.dtype, self.steps = maps, dtype, []

    def convolve(
        self,
        sources: Sequence[Source],
        layer: nn.Conv2d,
        activated: bool = False,
        plus: int | None = None,
        after: str | None = None,
    ) -> int:
        """Add a convolution; index of its value."""
        together = TOGETHER if after == "sigmoid" else 1
        convolution = packed(layer, self.dtype, together, activated)
        return self.add(Step(tuple(sources), convolution, plus, after))

    def add(self, step: Step) -> int:
        """Add a step; index of its value."""
        self.steps.append(step)
        return self.maps + len(self.steps) - 1


def _light(renderer: FeatureRenderer, writer: _Writer) -> None:
    config, hidden, width = renderer.config, None, 0
    for level, features in enumerate(reversed(config.features)):
        sources = [Source(len(config.features) - 1 - level, features)]
        if hidden is not None:
            sources.append(Source(hidden, width, "edges"))
        hidden = writer.convolve(sources, renderer.inputs[level])
        width = renderer.inputs[level].out_channels
        for block in renderer.blocks[level]:
            inner = [Source(hidden, width, activated=True)]
            inner = writer.convolve(inner, block.first, activated=True)
            hidden = writer.convolve([Source(inner, width)], block.second, plus=hidden)
    coarse = 0
    for layer in renderer.outputs:
        sources = [Source(hidden, width, "edges", activated=True)]
        hidden, width = writer.convolve(sources, layer), layer.out_channels
        coarse = writer.add(Step((Source(coarse, 3, "edges"),)))
    sources = [Source(hidden, width, activated=True)]
    writer.convolve(sources, renderer.picture, plus=coarse, after="sigmoid")


def _paper(renderer: PaperFeatureRenderer, writer: _Writer) -> None:
    config = renderer.config
    sources = [Source(len(config.features) - 1, config.features[-1])]
    for level, blocks in enumerate(renderer.blocks):
        if level:
            rise = renderer.rises[level - 1]
            finer = len(config.features) - 1 - level
            risen = writer.convolve([_doubled(sources[0])], rise, activated=True)
            sources = [Source(risen, rise.out_channels), Source(finer, config.features[finer])]
        for block in blocks:
            sources = [_block(sources, block, writer)]
    for rise in renderer.outputs:
        risen = writer.convolve([_doubled(sources[0])], rise, activated=True)
        sources = [Source(risen, rise.out_channels)]
    writer.convolve(sources, renderer.picture, after="sigmoid")


def _direct(renderer: DirectRenderer, writer: _Writer) -> None:
    writer.add(Step((Source(0, renderer.config.features[0]),), after="sigmoid"))


def _doubled(source: Source) -> Source:
    return Source(source.index, source.channels, "corners")


def _block(sources: Sequence[Source], block: nn.Module, writer: _Writer) -> Source:
    straight = sources[0].index
    if block.shortcut is not None:
        straight = writer.convolve(sources, block.shortcut)
    width = block.second.out_channels
    inner = Source(writer.convolve(sources, block.first, activated=True), width)
    after = "relu" if block.activated else None
    return Source(writer.convolve([inner], block.second, plus=straight, after=after), width)
