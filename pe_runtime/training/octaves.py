"""Coarse to fine: the octaves of positional encodings open one after the other.

High octaves let a field fit a single picture long before it knows the shape. Weighted by a window
that opens over the training, they join when the coarse shape stands (Park et al., Nerfies).
"""

import contextlib
import math
from collections.abc import Iterator

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pe_runtime.field.layers import PositionalEncoding
from pe_runtime.networks import SynthesisNetworks


class OctaveWindows:
    """Windows on the positional encodings of all fields, set before every step.

    While one is open it weights what an encoding returns; networks and their weights do not know.

    Args:
        networks: Whose fields are trained.
        field_share: Share of the training over which the fields' octaves open; 0 for open ones.
        bending_share: The same of ray bending.
    """

    def __init__(
        self, networks: SynthesisNetworks, field_share: float, bending_share: float
    ) -> None:
        self.shares: dict[PositionalEncoding, float] = {}
        self.windows: dict[nn.Module, Tensor] = {}
        self.networks = networks
        for field in networks.fields.values():
            self._watch(field.encoding, field_share)
            if field.bending is not None:
                self._watch(field.bending.encoding, bending_share)

    def open(self, progress: float) -> None:
        """Set all windows for a point of the training in [0, 1]."""
        for encoding, share in self.shares.items():
            if progress < share:
                self.windows[encoding] = window(encoding, progress / share)
            else:
                self.windows.pop(encoding, None)

    @contextlib.contextmanager
    def in_weights(self) -> Iterator[None]:
        """While this lasts, closed windows are part of the weights behind the encodings.

        A run that is broken off early is stored like this: whoever loads it knows no windows.
        """
        behind = [
            (layer.weight, self.windows[encoding])
            for encoding, layers in self._layers_behind()
            for layer in layers
            if encoding in self.windows
        ]
        before = [weight.detach().clone() for weight, _ in behind]
        with torch.no_grad():
            for weight, each in behind:
                weight *= each.to(weight)
        try:
            yield
        finally:
            with torch.no_grad():
                for (weight, _), old in zip(behind, before, strict=True):
                    weight.copy_(old)

    def _watch(self, encoding: PositionalEncoding, share: float) -> None:
        if share > 0:
            self.shares[encoding] = share
            encoding.register_forward_hook(self._weighted)

    def _weighted(self, encoding: nn.Module, _: tuple, encoded: Tensor) -> Tensor:
        if encoding not in self.windows:
            return encoded
        return encoded * self.windows[encoding].to(encoded)

    def _layers_behind(self) -> Iterator[tuple[PositionalEncoding, list[nn.Linear]]]:
        for field in self.networks.fields.values():
            skips = [field.skip] if field.config.field.skip else []
            yield field.encoding, [field.layers[0], *skips]
            if field.bending is not None:
                skips = [field.bending.skip_encoding] if field.bending.skip else []
                yield field.bending.encoding, [field.bending.layers[0], *skips]


def window(encoding: PositionalEncoding, share: float) -> Float[Tensor, " features"]:
    """Weight of each feature of an encoding of which a share in [0, 1] is open.

    Octave k of L is weighted by (1 - cos(pi clamp(share L - k, 0, 1))) / 2; the point itself
    always is there.
    """
    octaves = len(encoding.frequencies)
    open_ = (share * octaves - torch.arange(octaves)).clamp(0, 1)
    weights = ((1 - torch.cos(math.pi * open_)) / 2).repeat_interleave(encoding.dimensions)
    return torch.cat([torch.ones(encoding.dimensions), weights, weights])
