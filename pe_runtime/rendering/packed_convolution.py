"""Convolutions ready to run: weights in the backend's own order, ReLU included.

A convolution of a part of a map gives the very bits that the whole map's gives there. For that, all
of them go to oneDNN with channels last, whatever their size; `torch.conv2d` would send small ones
elsewhere, where sums have another order.
"""

from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Float
from torch import Tensor, nn


@dataclass(frozen=True)
class PackedConvolution:
    """A convolution without padding of its own.

    Attributes:
        weight: Of a convolution that gives `together` neighbours of a row at once, channels last.
        bias: As many.
        radius: Margin that the input has around the output, cells.
        together: Neighbours of a row that are computed as one cell with more channels. Three
            channels alone would leave most of a vector register empty.
        activated: Whether a ReLU follows.
    """

    weight: Float[Tensor, "wide narrow rows columns"]
    bias: Float[Tensor, " wide"]
    radius: int
    together: int = 1
    activated: bool = False

    @property
    def channels(self) -> int:
        """Channels of the result."""
        return self.bias.shape[0] // self.together

    @cached_property
    def packed(self) -> Tensor | None:
        """The weight in oneDNN's order; None where convolutions do not run there."""
        if not _runs_on_onednn(self.weight.device, self.weight.dtype):
            return None
        stride = [1, self.together]
        return torch.ops.mkldnn._reorder_convolution_weight(
            self.weight, [0, 0], stride, [1, 1], 1, None
        )

    @property
    def products(self) -> int:
        """Multiplications per cell of the result."""
        return self.weight.numel() // self.together

    def spare(self, columns: int) -> int:
        """Columns that the input needs at its right so that the last neighbours are complete."""
        if self.together == 1:
            return 0
        # oneDNN 3.12 leaves out channels of some bfloat16 results that are one cell wide.
        return max(-columns % self.together, 2 * self.together - columns)

    def __call__(
        self, padded: Float[Tensor, "1 narrow rows columns"], columns: int
    ) -> Float[Tensor, "1 channels height width"]:
        """Convolve.

        Args:
            padded: Input with its margin, and with spare columns where needed.
            columns: Width of the result.
        """
        out = self._run(padded)
        if self.together > 1:
            cells = out[0].permute(1, 2, 0)
            cells = cells.reshape(cells.shape[0], -1, self.channels)[:, :columns]
            out = cells.permute(2, 0, 1)[None]
        return out

    def _run(self, padded: Tensor) -> Tensor:
        stride = [1, self.together]
        if self.packed is not None:
            after = "relu" if self.activated else "none"
            return torch.ops.mkldnn._convolution_pointwise(
                padded, self.packed, self.bias, [0, 0], stride, [1, 1], 1, after, [], ""
            )
        out = nn.functional.conv2d(padded, self.weight, self.bias, stride)
        return out.relu_() if self.activated else out


def _runs_on_onednn(device: torch.device, dtype: torch.dtype) -> bool:
    if device.type != "cpu" or not torch.backends.mkldnn.is_available():
        return False
    if dtype == torch.bfloat16:
        return torch.ops.mkldnn._is_mkldnn_bf16_supported()
    return dtype == torch.float32


def packed(
    layer: nn.Conv2d, dtype: torch.dtype, together: int = 1, activated: bool = False
) -> PackedConvolution:
    """A copy of a layer with the given numbers.

    Args:
        layer: Any convolution that keeps the size.
        dtype: Of the input and of the result.
        together: See `PackedConvolution`.
        activated: Whether a ReLU follows.
    """
    weight = layer.weight.detach().to(dtype)
    wide, narrow, rows, columns = weight.shape
    shifted = weight.new_zeros(together, wide, narrow, rows, columns + together - 1)
    for number in range(together):
        shifted[number, ..., number : number + columns] = weight
    shifted = shifted.reshape(-1, *shifted.shape[2:]).contiguous(memory_format=torch.channels_last)
    bias = layer.bias.detach().to(dtype).repeat(together)
    return PackedConvolution(shifted, bias, columns // 2, together, activated)
