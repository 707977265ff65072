"""V and B of one object in one state: style and pose are part of the weights, rows go in blocks.

Style and pose are the same for all samples of an object in a frame. Folded into weights and biases
once, they cost nothing per sample. Rows go through all layers in blocks that fit the processor's
caches; what a row becomes does not depend on the rows beside it, so any bundle of rays gets the
same numbers to the last bit.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import linear

from pe_runtime.config import ObjectClassConfig
from pe_runtime.field.bending import RayBending
from pe_runtime.field.layers import PositionalEncoding
from pe_runtime.field.object_field import ObjectField

EXACT_BLOCK = 1024
"""Rows that go through the layers together in float32: 1 MB of 256 features."""

BLOCK = 4096
"""The same in bfloat16."""

BUCKET = 256
"""Blocks in bfloat16 have a multiple of so many rows."""


@dataclass(frozen=True)
class Affine:
    """W x + b, and max(0, W x + b).

    Attributes:
        weight: (outputs, inputs).
        bias: (outputs).
        packed: The weight as oneDNN's kernels want it, which are twice as fast as the plain
            product and join the ReLU to it; None where there is no oneDNN.
    """

    weight: Float[Tensor, "outputs inputs"]
    bias: Float[Tensor, " outputs"]
    packed: Tensor | None

    def __call__(
        self, rows: Float[Tensor, "rows inputs"], relu: bool = False
    ) -> Float[Tensor, "rows outputs"]:
        """All rows through the layer, and through a ReLU if asked for."""
        if self.packed is not None:
            after = "relu" if relu else "none"
            return torch.ops.mkldnn._linear_pointwise(rows, self.packed, self.bias, after, [], "")
        result = linear(rows, self.weight, self.bias)
        return torch.relu_(result) if relu else result


@dataclass(frozen=True)
class Trunk:
    """Layers with ReLUs between; one may see the encoded position again."""

    encoding: PositionalEncoding
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
        """Encoded positions, with zeros behind them up to the width of the weights."""
        weight = self.layers[0].weight
        whole = coordinates.new_empty(coordinates.shape[0], weight.shape[1])
        count = self.encoding.features
        whole[:, :count] = self.encoding(coordinates)
        whole[:, count:] = 0.0
        return whole.to(weight.dtype)


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
        output: Last linear layer, applied once per ray; float32.
    """

    config: ObjectClassConfig
    dtype: torch.dtype
    bend: tuple[Trunk, Affine] | None
    trunk: Trunk
    density: Affine | None
    densities: Callable[[Tensor], Tensor]
    head: tuple[Affine, ...]
    output: Affine
    entering: tuple[int, ...]

    @property
    def block(self) -> int:
        """Rows that go through its layers together."""
        return EXACT_BLOCK if self.dtype == torch.float32 else BLOCK

    @property
    def head_width(self) -> int:
        """Features of a sample before the last linear layer."""
        return self.head[-1].bias.shape[0]

    def hidden(self, coordinates: Float[Tensor, "rows dims"]) -> Float[Tensor, "rows width"]:
        """Hidden features of sample points, after bending.

        Args:
            coordinates: As `ObjectField.trunk` takes them; float32.
        """
        return in_blocks(self._hidden, coordinates, self.trunk.layers[-1].bias, self.block)

    def geometry(
        self, coordinates: Float[Tensor, "rows dims"]
    ) -> tuple[Float[Tensor, "rows width"], Float[Tensor, " rows"]]:
        """Hidden features and densities per metre (float32) of sample points."""
        hidden = self.hidden(coordinates)
        like = self.output.bias.new_empty(1)
        return hidden, in_blocks(self._density, hidden, like, self.block)[:, 0]

    def branch(self, hidden: Float[Tensor, "rows width"]) -> Float[Tensor, "rows head"]:
        """Feature branch up to its last linear layer, float32."""
        like = self.output.bias.new_empty(self.head_width)
        return in_blocks(self._branch, hidden, like, self.block)

    def last_layer(
        self,
        integrated: Float[Tensor, "rays head"],
        share: Float[Tensor, " rays"],
        channels: slice,
    ) -> Float[Tensor, "rays channels"]:
        """Last linear layer on integrated features: sum w (W h + b) = W sum(w h) + b sum(w)."""
        weight, bias = self.output.weight[channels], self.output.bias[channels]
        drawn = in_blocks(lambda rows: linear(rows, weight), integrated, bias, EXACT_BLOCK)
        return drawn.addcmul_(share[:, None], bias)

    def _hidden(self, coordinates: Tensor) -> Tensor:
        if self.bend is not None:
            trunk, output = self.bend
            moved = output(trunk(coordinates)).float()
            coordinates = (coordinates + moved).clamp_(-1.0, 1.0)
        return self.trunk(coordinates[:, self.entering])

    def _density(self, hidden: Tensor) -> Tensor:
        return self.densities(self.density(hidden).float())

    def _branch(self, hidden: Tensor) -> Tensor:
        for layer in self.head:
            hidden = layer(hidden, relu=True)
        return hidden


def fold_field(
    field: ObjectField,
    style: Float[Tensor, " style"],
    pose: Float[Tensor, " pose"],
    dtype: torch.dtype = torch.float32,
) -> FoldedField:
    """Fold a style and a pose into the weights of a field.

    gamma (W h + b) + beta is another weight and bias; W_p pi is a bias of B's first layer.

    Args:
        field: V and B of the object's class.
        style: w.
        pose: pi; ignored by classes that do not bend.
        dtype: Of weights and products.
    """
    config = field.config
    skip = field.skip.weight if config.field.skip else None
    parts = [(each.weight, each.bias) for each in field.layers]
    layers = tuple(_affine(w, b, dtype) for w, b in [_widened(*parts[0]), *parts[1:]])
    again = None if skip is None else _affine(_widened(skip)[0], _zeros(skip), dtype)
    head = []
    for layer, modulation in zip(field.head, field.modulations, strict=True):
        scale, shift = (each[0] for each in modulation(style[None]))
        head.append(_affine(layer.weight * scale[:, None], layer.bias * scale + shift, dtype))
    density = field.density
    return FoldedField(
        config,
        dtype,
        None if field.bending is None else _folded_bending(field.bending, pose, dtype),
        Trunk(field.encoding, layers, config.field.skip, again),
        None if density is None else _affine(density.weight, density.bias, dtype),
        field.density_of,
        tuple(head),
        _affine(field.output.weight, field.output.bias, torch.float32),
        tuple(field.entering),
    )


def _folded_bending(bending: RayBending, pose: Tensor, dtype: torch.dtype) -> tuple[Trunk, Affine]:
    layers = [[each.weight, each.bias] for each in bending.layers]
    layers[0][1] = layers[0][1] + linear(pose, bending.pose.weight)
    layers[0] = list(_widened(*layers[0]))
    again = None
    if bending.skip:
        layers[bending.skip][1] = layers[bending.skip][1] + linear(pose, bending.skip_pose.weight)
        skip = bending.skip_encoding.weight
        again = _affine(_widened(skip)[0], _zeros(skip), dtype)
    folded = tuple(_affine(weight, bias, dtype) for weight, bias in layers)
    output = _affine(bending.output.weight, bending.output.bias, dtype)
    return Trunk(bending.encoding, folded, bending.skip, again), output


def _widened(weight: Tensor, bias: Tensor | None = None) -> tuple[Tensor, Tensor | None]:
    """Columns of zeros up to a multiple of four, without which a row's sum depends on its place."""
    return torch.nn.functional.pad(weight, (0, -weight.shape[1] % 4)), bias


def _zeros(weight: Tensor) -> Tensor:
    return weight.new_zeros(weight.shape[0])


def _affine(weight: Tensor, bias: Tensor, dtype: torch.dtype) -> Affine:
    weight, bias = weight.detach().to(dtype).contiguous(), bias.detach().to(dtype)
    packed = None
    if _packs(weight.device.type, dtype):
        packed = torch.ops.mkldnn._reorder_linear_weight(weight, None)
    return Affine(weight, bias, packed)


@functools.cache
def _packs(kind: str, dtype: torch.dtype) -> bool:
    """Whether oneDNN has products with packed weights here."""
    if kind != "cpu" or not torch.backends.mkldnn.is_available():
        return False
    if not hasattr(torch.ops.mkldnn, "_linear_pointwise"):
        return False
    return dtype == torch.float32 or torch.ops.mkldnn._is_mkldnn_bf16_supported()


def in_blocks(
    function: Callable[[Tensor], Tensor],
    rows: Float[Tensor, "rows inputs"],
    like: Float[Tensor, " outputs"],
    block: int,
) -> Float[Tensor, "rows outputs"]:
    """Apply a function to blocks of rows; the result has the width and type of `like`.

    In float32 every block is filled up to its full size: a product of another size may sum in
    another order. In bfloat16, where that does not count, it is filled up to whole buckets.
    """
    count, unit = rows.shape[0], block if block == EXACT_BLOCK else BUCKET
    whole = like.new_empty(count, like.shape[0])
    for start in range(0, count, block):
        part = rows[start : start + block]
        filled = torch.nn.functional.pad(part, (0, 0, 0, -part.shape[0] % unit))
        whole[start : start + block] = function(filled)[: part.shape[0]]
    return whole
