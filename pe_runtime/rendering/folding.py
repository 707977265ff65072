"""Style and pose folded into the weights of V and B.

They are the same for all samples of an object in a frame. As parts of weights and biases they cost
nothing per sample: gamma (W h + b) + beta is another weight and bias, W_p pi is a bias of B's first
layer. What depends on neither is packed once per model and precision, what depends on the style
once per style; a new pose costs a few small products.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import linear

from pe_runtime.field.layers import PositionalEncoding
from pe_runtime.field.object_field import ObjectField
from pe_runtime.rendering.affine import Affine, affine, widened
from pe_runtime.rendering.folded_field import FoldedField, LastLayer, Trunk


class FieldFolder:
    """Folds states into one field at one precision.

    Args:
        field: V and B of a class; later changes of their weights do not reach what is folded.
        dtype: Of weights and products.
    """

    def __init__(self, field: ObjectField, dtype: torch.dtype = torch.float32) -> None:
        self.field, self.dtype = field, dtype
        skip = field.skip.weight if field.config.field.skip else None
        self._trunk = _trunk(field, field.config.field.skip, skip, dtype)
        density = field.density
        self._density = None if density is None else affine(density.weight, density.bias, dtype)
        self._last: dict[tuple[int, int], LastLayer] = {}
        self._bend = None
        if field.bending is not None:
            bending = field.bending
            skip = bending.skip_encoding.weight if bending.skip else None
            output = affine(bending.output.weight, bending.output.bias, dtype)
            self._bend = _trunk(bending, bending.skip, skip, dtype), output

    def fold(
        self,
        style: Float[Tensor, " style"],
        pose: Float[Tensor, " pose"],
        like: FoldedField | None = None,
    ) -> FoldedField:
        """The field of an object with a style and a pose.

        Args:
            style: w.
            pose: pi; ignored by classes that do not bend.
            like: What this object's style was folded into before, to be used again.
        """
        head = self._head(style) if like is None else like.head
        return FoldedField(
            self.field.config,
            self.dtype,
            None if self._bend is None else self._bent(pose),
            self._trunk,
            self._density,
            self.field.density_of,
            head,
            self._last_layer,
            tuple(self.field.entering),
        )

    def _head(self, style: Tensor) -> tuple[Affine, ...]:
        head = []
        for layer, modulation in zip(self.field.head, self.field.modulations, strict=True):
            scale, shift = (each[0] for each in modulation(style[None]))
            weight, bias = layer.weight * scale[:, None], layer.bias * scale + shift
            head.append(affine(weight, bias, self.dtype))
        return tuple(head)

    def _bent(self, pose: Tensor) -> tuple[Trunk, Affine]:
        bending, (trunk, output) = self.field.bending, self._bend
        layers = list(trunk.layers)
        for index, entry in (
            (0, bending.pose),
            (bending.skip, getattr(bending, "skip_pose", None)),
        ):
            if entry is not None:
                bias = bending.layers[index].bias + linear(pose, entry.weight)
                layers[index] = replace(layers[index], bias=bias.detach().to(self.dtype))
        return replace(trunk, layers=tuple(layers)), output

    def _last_layer(self, channels: slice) -> LastLayer:
        key = channels.start, channels.stop
        if key not in self._last:
            layer = self.field.output
            product = affine(layer.weight[channels], None, torch.float32)
            self._last[key] = LastLayer(product, layer.bias[channels].detach().float())
        return self._last[key]


def _trunk(network: torch.nn.Module, skip: int, again: Tensor | None, dtype: torch.dtype) -> Trunk:
    """The layers of V or B as they are."""
    first, *others = network.layers
    layers = [affine(widened(first.weight), first.bias, dtype)]
    layers += [affine(each.weight, each.bias, dtype) for each in others]
    return Trunk(
        _angles(network.encoding),
        tuple(layers),
        skip,
        None if again is None else affine(widened(again), None, dtype),
    )


def _angles(encoding: PositionalEncoding) -> Float[Tensor, "dims waves"]:
    """The matrix from positions to the angles of their encoding, 2^k f in its places."""
    octaves = len(encoding.frequencies)
    one = torch.eye(encoding.dimensions, device=encoding.frequencies.device)
    return one.repeat(1, octaves) * encoding.frequencies.repeat_interleave(encoding.dimensions)
