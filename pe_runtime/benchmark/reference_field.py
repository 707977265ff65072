"""V and B in float64, written from the paper's equations and from the names in a model file.

Shares no code with `field`: what the renderer folds, compacts or leaves out is all here, one
product after the other.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from pe_runtime.config import ObjectClassConfig

DENSITY_SHIFT = 2.5
ROWS = 16384
"""Points that are evaluated at once."""

Weights = Mapping[str, Tensor]
"""Tensors by their name in a model file, below a prefix."""


@dataclass(frozen=True)
class ReferenceField:
    """V with its B, in one state.

    Attributes:
        config: The object's class.
        weights: Tensors below `synthesis.fields.CLASS.`, float64.
        style: w, float64.
        pose: pi, float64.
    """

    config: ObjectClassConfig
    weights: Weights
    style: Float[Tensor, " style"]
    pose: Float[Tensor, " pose"]

    def coordinates(self, points: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3"]:
        """Object-frame points (metres) in half box sizes, kept within the volume."""
        low, high = points.new_tensor(self.config.low), points.new_tensor(self.config.high)
        return ((points - (low + high) / 2) / ((high - low) / 2)).clamp(-1.0, 1.0)

    def density(self, coordinates: Float[Tensor, "points dims"]) -> Float[Tensor, " points"]:
        """Density per metre."""
        raw = in_pieces(lambda at: linear(self.weights, "density", self._trunk(at)), coordinates)
        if self.config.field.density == "relu":
            return relu(raw[:, 0]) * self.config.field.density_scale
        softplus = torch.logaddexp(raw[:, 0] - DENSITY_SHIFT, torch.zeros_like(raw[:, 0]))
        return softplus * self.config.field.density_scale

    def features(
        self, coordinates: Float[Tensor, "points dims"], channels: slice
    ) -> Float[Tensor, "points channels"]:
        """Features of some channels, style-modulated (paper, eq. 3)."""
        return in_pieces(lambda at: self._features(at)[:, channels], coordinates)

    def _features(self, coordinates: Tensor) -> Tensor:
        hidden = self._trunk(coordinates)
        for number in range(2):
            hidden = linear(self.weights, f"head.{number}", hidden)
            hidden = relu(self._styled(hidden, f"modulations.{number}"))
        return linear(self.weights, "output", hidden)

    def _styled(self, hidden: Tensor, name: str) -> Tensor:
        if self.config.style_features == 0:
            return hidden
        if self.config.style_input == "concatenation":
            return hidden + self.style @ self.weights[f"{name}.shift.weight"].T
        scale = linear(self.weights, f"{name}.scale", self.style[None])
        return scale * hidden + linear(self.weights, f"{name}.shift", self.style[None])

    def _trunk(self, coordinates: Tensor) -> Tensor:
        config = self.config.field
        if self.config.bending is not None:
            coordinates = (coordinates + self._displacement(coordinates)).clamp(-1.0, 1.0)
        entering = [*self.config.axes, *((3, 4, 5) if self.config.sees_origin else ())]
        encoded = encode(coordinates[:, entering], config.octaves, config.base_frequency)
        hidden = relu(linear(self.weights, "layers.0", encoded))
        for layer in range(1, config.depth):
            hidden = linear(self.weights, f"layers.{layer}", hidden)
            if layer == config.skip:
                hidden = hidden + encoded @ self.weights["skip.weight"].T
            hidden = relu(hidden)
        return hidden

    def _displacement(self, coordinates: Tensor) -> Tensor:
        """B(x, pi), in half box sizes (paper, eq. 2)."""
        config, weights = self.config.bending, self.weights
        encoded = encode(coordinates, config.octaves, config.base_frequency)
        hidden = linear(weights, "bending.layers.0", encoded)
        hidden = hidden + self.pose @ weights["bending.pose.weight"].T
        for layer in range(1, config.depth):
            hidden = linear(weights, f"bending.layers.{layer}", relu(hidden))
            if layer == config.skip:
                hidden = hidden + encoded @ weights["bending.skip_encoding.weight"].T
                hidden = hidden + self.pose @ weights["bending.skip_pose.weight"].T
        return linear(weights, "bending.output", relu(hidden))


def encode(
    points: Float[Tensor, "points dims"], octaves: int, base_frequency: float
) -> Float[Tensor, "points encoded"]:
    """gamma(p) = (p, sin(2^k f p), cos(2^k f p)), all sines before all cosines."""
    # The model knows its base frequency as a float32 number; that number is meant.
    base = float(torch.tensor(base_frequency, dtype=torch.float32))
    angles = [base * 2.0**octave * points for octave in range(octaves)]
    sines, cosines = [torch.sin(a) for a in angles], [torch.cos(a) for a in angles]
    return torch.cat([points, *sines, *cosines], dim=-1)


def linear(weights: Weights, name: str, rows: Tensor) -> Tensor:
    """W x + b of a named layer."""
    return rows @ weights[f"{name}.weight"].T + weights[f"{name}.bias"]


def relu(values: Tensor) -> Tensor:
    """max(0, v)."""
    return values.clamp(min=0.0)


def in_pieces(function: Callable[[Tensor], Tensor], rows: Tensor) -> Tensor:
    """A function of rows, so many at a time that the memory stays small."""
    pieces = max(1, math.ceil(rows.shape[0] / ROWS))
    return torch.cat([function(piece) for piece in rows.tensor_split(pieces)])
