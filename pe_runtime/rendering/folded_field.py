"""V and B of one object in one state, ready to be asked at many points (made by `folding`).

Rows go through all layers in blocks that fit the processor's caches; what a row becomes does not
depend on the rows beside it, so any bundle of rays gets the same numbers to the last bit.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from pe_runtime.config import ObjectClassConfig
from pe_runtime.rendering.affine import Affine


@dataclass(frozen=True)
class Blocks:
    """How rows are bundled.

    Attributes:
        rows: That go through the layers together.
        sizes: Numbers of rows to which a block is filled up; the last is `rows`. Few, since a
            backend prepares itself for every size that it meets, and keeps what it prepared.
    """

    rows: int
    sizes: tuple[int, ...]

    def filled(self, count: int) -> int:
        """The size of a block of so many rows."""
        return next(size for size in self.sizes if size >= count)


EXACT = Blocks(1024, (1024,))
"""In float32: 1 MB of 256 features. A product of another size may sum in another order, so every
block is filled up to its full size."""

FAST = Blocks(4096, (256, 512, 1024, 2048, 4096))
"""In bfloat16, where that does not count."""


STEP = 2048
"""Results lie in memory for a multiple of so many rows."""


@dataclass(frozen=True)
class Trunk:
    """Layers with ReLUs between; one may see the encoded position again.

    Attributes:
        frequencies: From positions to the angles of their encoding. A product with a matrix that is
            nearly empty, but the same numbers as, and a sixth of the time of, one by one.
        layers: In order.
        skip: Which layer sees the encoding again; 0 for none.
        again: What that layer does to the encoding.
    """

    frequencies: Float[Tensor, "dims waves"]
    layers: tuple[Affine, ...]
    skip: int
    again: Affine | None

    def __call__(self, coordinates: Float[Tensor, "rows dims"]) -> Float[Tensor, "rows width"]:
        """Hidden features, after the last ReLU."""
        encoded = self._encoded(coordinates)
        hidden = self.layers[0](encoded, relu=True)
        for index, layer in enumerate(self.layers[1:], start=1):
            if index == self.skip and self.again is not None:
                hidden = torch.relu_(layer(hidden).add_(self.again(encoded)))
            else:
                hidden = layer(hidden, relu=True)
        return hidden

    def _encoded(self, coordinates: Tensor) -> Tensor:
        """Encoded positions, with zeros behind them up to the width of the weights.

        The numbers of `PositionalEncoding`, written straight to where the first layer reads them.
        """
        weight, dims = self.layers[0].weight, coordinates.shape[1]
        whole = weight.new_empty(coordinates.shape[0], weight.shape[1])
        angles = coordinates @ self.frequencies
        cosines, rest = dims + angles.shape[1], dims + 2 * angles.shape[1]
        whole[:, :dims] = coordinates
        whole[:, dims:cosines] = torch.sin(angles)
        whole[:, cosines:rest] = angles.cos_()
        if rest < whole.shape[1]:
            whole[:, rest:] = 0.0
        return whole


@dataclass(frozen=True)
class LastLayer:
    """The last linear layer for some channels, its bias apart; float32."""

    product: Affine
    bias: Float[Tensor, " channels"]


@dataclass(frozen=True)
class FoldedField:
    """The field of one object in one state, at one precision.

    Attributes:
        config: Of its class.
        dtype: Of products; sums are float32 either way.
        bend: B with its output layer, or None.
        trunk: V up to the last hidden features.
        density: Raw density, or None for opaque classes.
        densities: From raw outputs to densities per metre.
        head: Feature branch up to its last linear layer.
        output: Gives the last linear layer, which is applied once per ray, for some channels.
        entering: Which coordinates V sees.
    """

    config: ObjectClassConfig
    dtype: torch.dtype
    bend: tuple[Trunk, Affine] | None
    trunk: Trunk
    density: Affine | None
    densities: Callable[[Tensor], Tensor]
    head: tuple[Affine, ...]
    output: Callable[[slice], LastLayer]
    entering: tuple[int, ...]

    @property
    def head_width(self) -> int:
        """Features of a sample before the last linear layer."""
        return self.head[-1].bias.shape[0]

    @property
    def _blocks(self) -> Blocks:
        return EXACT if self.dtype == torch.float32 else FAST

    def hidden(self, coordinates: Float[Tensor, "rows dims"]) -> Float[Tensor, "rows width"]:
        """Hidden features of sample points, after bending.

        Args:
            coordinates: As `ObjectField.trunk` takes them; float32.
        """
        hidden = _rows_like(self.trunk.layers[-1].bias, coordinates)
        in_blocks(lambda part: (self._hidden(part),), coordinates, (hidden,), self._blocks)
        return hidden

    def geometry(
        self, coordinates: Float[Tensor, "rows dims"]
    ) -> tuple[Float[Tensor, "rows width"], Float[Tensor, " rows"]]:
        """Hidden features and densities per metre (float32) of sample points."""
        hidden = _rows_like(self.trunk.layers[-1].bias, coordinates)
        density = coordinates.new_empty(coordinates.shape[0], 1)
        in_blocks(self._geometry, coordinates, (hidden, density), self._blocks)
        return hidden, density[:, 0]

    def branch(self, hidden: Float[Tensor, "rows width"]) -> Float[Tensor, "rows head"]:
        """Feature branch up to its last linear layer, float32."""
        features = _rows_like(self.head[-1].bias.float(), hidden)
        in_blocks(self._branch, hidden, (features,), self._blocks)
        return features

    def last_layer(
        self,
        integrated: Float[Tensor, "rays head"],
        share: Float[Tensor, " rays"],
        channels: slice,
    ) -> Float[Tensor, "rays channels"]:
        """Last linear layer on integrated features: sum w (W h + b) = W sum(w h) + b sum(w)."""
        layer = self.output(channels)
        drawn = _rows_like(layer.bias, integrated)
        in_blocks(lambda part: (layer.product(part),), integrated, (drawn,), EXACT)
        return drawn.addcmul_(share[:, None], layer.bias)

    def _hidden(self, coordinates: Tensor) -> Tensor:
        if self.bend is not None:
            trunk, output = self.bend
            coordinates = torch.add(coordinates, output(trunk(coordinates))).clamp_(-1.0, 1.0)
        if self.entering != tuple(range(coordinates.shape[1])):
            coordinates = coordinates[:, self.entering]
        return self.trunk(coordinates)

    def _geometry(self, coordinates: Tensor) -> tuple[Tensor, Tensor]:
        hidden = self._hidden(coordinates)
        return hidden, self.densities(self.density(hidden).float())

    def _branch(self, hidden: Tensor) -> tuple[Tensor]:
        for layer in self.head:
            hidden = layer(hidden, relu=True)
        return (hidden,)


def _rows_like(row: Tensor, rows: Tensor) -> Tensor:
    """As many rows as there are, each of the size and type of one; not filled.

    Memory of sizes that come again can be used again: it is asked for in steps.
    """
    count = rows.shape[0]
    return row.new_empty(count + -count % STEP, row.shape[0])[:count]


def in_blocks(
    function: Callable[[Tensor], Sequence[Tensor]],
    rows: Float[Tensor, "rows inputs"],
    results: Sequence[Float[Tensor, "rows _"]],
    blocks: Blocks,
) -> None:
    """Apply a function to blocks of rows and write what it gives.

    Args:
        function: From a block to as many results.
        rows: Its input.
        results: Written over; rows that only filled a block up are left out.
        blocks: How rows are bundled.
    """
    for start in range(0, rows.shape[0], blocks.rows):
        part = rows[start : start + blocks.rows]
        count = part.shape[0]
        missing = blocks.filled(count) - count
        if missing:
            part = torch.nn.functional.pad(part, (0, 0, 0, missing))
        for whole, found in zip(results, function(part), strict=True):
            whole[start : start + blocks.rows] = found[:count]
