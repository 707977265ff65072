"""Composition of all objects along a ray, as pure functions named after the equations."""

from collections.abc import Callable

import torch
from jaxtyping import Float
from torch import Tensor

OPAQUE = 1e4
"""Optical thickness of opaque surfaces: exp(-OPAQUE) is exactly 0 in float32 and float64."""


def exclusive_sum(values: Float[Tensor, "rays samples"]) -> Float[Tensor, "rays samples"]:
    """Sum of all earlier samples, sum_{j<i} v_j.

    The values are shifted before they are summed. Summing first and subtracting v_i afterwards
    would lose every small earlier value to cancellation when v_i is huge.
    """
    shifted = torch.cat([torch.zeros_like(values[:, :1]), values[:, :-1]], dim=-1)
    return torch.cumsum(shifted, dim=-1)


def weights_from_thickness(
    thickness: Float[Tensor, "rays samples"],
) -> Float[Tensor, "rays samples"]:
    """Share of each sample in its ray, w_i = exp(-sum_{j<i} tau_j) (1 - exp(-tau_i)).

    Args:
        thickness: Optical thickness tau = sigma * delta >= 0 of the samples, nearest first.

    Returns:
        Weights >= 0 that sum to at most 1; e.g. tau = (0, ln 2, 1e4) gives (0, 0.5, 0.5).
    """
    transmittance = torch.exp(-exclusive_sum(thickness))
    return transmittance * -torch.expm1(-thickness)


def composite(
    depth: Float[Tensor, "rays samples"],
    thickness: Float[Tensor, "rays samples"],
    extend: Callable[[Tensor, Tensor], Tensor] | None = None,
) -> Float[Tensor, "rays samples"]:
    """Weights of unsorted samples of all objects together, in the order in which they came.

    Objects may overlap: each sample keeps the thickness of its own object's interval, so
    densities add where volumes intersect. Equal depths are taken in the given order.

    Args:
        depth: Ray parameter of each sample.
        thickness: Optical thickness of each sample; 0 where an object is missed.
        extend: Turns sorted depths and thicknesses into thicknesses, for quadratures in which the
            neighbours on the ray decide how far a sample reaches.
    """
    if depth.shape[1] == 0:
        return thickness
    order = torch.argsort(depth, dim=-1, stable=True)
    thickness = torch.gather(thickness, 1, order)
    if extend is not None:
        thickness = extend(torch.gather(depth, 1, order), thickness)
    sorted_weights = weights_from_thickness(thickness)
    return torch.empty_like(sorted_weights).scatter(1, order, sorted_weights)
