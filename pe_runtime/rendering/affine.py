"""Linear layers with fixed weights, in the form that the backend multiplies fastest."""

import functools
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import linear


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
            return _pointwise()(rows, self.packed, self.bias, after, [], "")
        result = linear(rows, self.weight, self.bias)
        return torch.relu_(result) if relu else result


def affine(
    weight: Float[Tensor, "outputs inputs"],
    bias: Float[Tensor, " outputs"] | None,
    dtype: torch.dtype,
) -> Affine:
    """A layer ready to run.

    Args:
        weight: W; later changes of it do not reach the layer.
        bias: b; None for zeros.
        dtype: Of weights and products.
    """
    bias = weight.new_zeros(weight.shape[0]) if bias is None else bias
    weight, bias = weight.detach().to(dtype).contiguous(), bias.detach().to(dtype)
    packed = None
    if _packs(weight.device.type, dtype):
        packed = torch.ops.mkldnn._reorder_linear_weight(weight, None)
    return Affine(weight, bias, packed)


def widened(weight: Float[Tensor, "outputs inputs"]) -> Float[Tensor, "outputs wide"]:
    """Columns of zeros up to a multiple of four, without which a row's sum depends on its place."""
    return torch.nn.functional.pad(weight, (0, -weight.shape[1] % 4))


@functools.cache
def _pointwise() -> torch._ops.OpOverload:
    """The product itself; looked up once, since a frame asks for hundreds."""
    return torch.ops.mkldnn._linear_pointwise.default


@functools.cache
def _packs(kind: str, dtype: torch.dtype) -> bool:
    """Whether oneDNN has products with packed weights here."""
    if kind != "cpu" or not torch.backends.mkldnn.is_available():
        return False
    if not hasattr(torch.ops.mkldnn, "_linear_pointwise"):
        return False
    return dtype == torch.float32 or torch.ops.mkldnn._is_mkldnn_bf16_supported()
