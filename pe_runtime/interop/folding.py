"""Batch statistics folded into the layer before them, exactly as they act at inference."""

from collections.abc import Mapping

import torch
from torch import Tensor

EPSILON = 1e-5


def batch_statistics(name: str, channels: int, affine: bool = False) -> dict[str, tuple[int, ...]]:
    """Names and shapes of a batch normalisation's entries.

    Args:
        name: Of the normalisation.
        channels: Its channels.
        affine: Whether it has a scale and a shift of its own.
    """
    entries: dict[str, tuple[int, ...]] = {
        f"{name}.running_mean": (channels,),
        f"{name}.running_var": (channels,),
        f"{name}.num_batches_tracked": (),
    }
    if affine:
        entries |= {f"{name}.weight": (channels,), f"{name}.bias": (channels,)}
    return entries


def folded_linear(
    weight: Tensor, bias: Tensor | None, tensors: Mapping[str, Tensor], name: str
) -> tuple[Tensor, Tensor]:
    """Weight and bias of a linear or convolution layer that a batch normalisation follows.

    y = gamma (W x + b - mean) / sqrt(var + eps) + beta, per output channel.

    Args:
        weight: (out, ...).
        bias: (out,), or None.
        tensors: All entries.
        name: The normalisation's, with or without a scale and a shift of its own.
    """
    mean = tensors[f"{name}.running_mean"].double()
    scale = (tensors[f"{name}.running_var"].double() + EPSILON).rsqrt()
    shift = torch.zeros_like(mean)
    if f"{name}.weight" in tensors:
        scale = scale * tensors[f"{name}.weight"].double()
        shift = tensors[f"{name}.bias"].double()
    before = torch.zeros_like(mean) if bias is None else bias.double()
    broadcast = scale.reshape(-1, *[1] * (weight.ndim - 1))
    return weight.double() * broadcast, (before - mean) * scale + shift
