"""What a stress case is: the numbers it is tried with, one measurement, and what it is held to.

A case is data. To add one, write a function from a `Trial` to an `Outcome` and list it with its
ranges; the table tries their corners and some draws, the property tests draw from all of them.
"""

import contextlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from pe_runtime.rendering.compositing import weights_from_thickness

PRECISIONS: Mapping[str, torch.dtype] = {
    "float64": torch.float64,
    "float32": torch.float32,
    "bfloat16": torch.bfloat16,
}
Weigh = Callable[[Tensor], Tensor]
"""From optical thickness, nearest sample first, to weights; both (rays, samples)."""


@dataclass(frozen=True)
class Spread:
    """The values that one number of a case takes.

    Attributes:
        corners: Values that are always tried, ascending; 0 and infinity only at the ends.
        scale: What lies between them: "log", "linear", "whole" (integers, logarithmically) or
            "none", for names given by their place in a list.
    """

    corners: tuple[float, ...]
    scale: str = "log"

    def at(self, share: float) -> float:
        """The value a share (0 to 1) of the way from the first corner to the last.

        On a logarithmic scale the ends are the outermost positive, finite corners.
        """
        if self.scale == "none":
            return self.corners[min(int(share * len(self.corners)), len(self.corners) - 1)]
        if self.scale == "linear":
            return self.corners[0] + share * (self.corners[-1] - self.corners[0])
        usual = [each for each in self.corners if 0 < each < math.inf]
        first, last = math.log(usual[0]), math.log(usual[-1])
        value = min(max(math.exp(first + share * (last - first)), usual[0]), usual[-1])
        return float(round(value)) if self.scale == "whole" else value


def one_of(names: Sequence[str]) -> Spread:
    """A spread of names; a trial's value is the place in the list."""
    return Spread(tuple(float(place) for place in range(len(names))), "none")


@dataclass(frozen=True)
class Trial:
    """One point of a case's ranges.

    Attributes:
        values: The numbers, by name.
        precision: A key of `PRECISIONS`.
        seed: Of everything that is drawn.
        weigh: How thicknesses become weights; another function shows that a case can fail.
    """

    values: Mapping[str, float]
    precision: str = "float32"
    seed: int = 0
    weigh: Weigh = weights_from_thickness

    def __getitem__(self, name: str) -> float:
        """The number of that name."""
        return self.values[name]

    @property
    def dtype(self) -> torch.dtype:
        """Of the tensors that functions are called with."""
        return PRECISIONS[self.precision]

    @property
    def epsilon(self) -> float:
        """Distance from 1 to the next number in this precision."""
        return torch.finfo(self.dtype).eps

    def count(self, name: str) -> int:
        """The number of that name as an integer."""
        return int(self.values[name])

    def generator(self) -> torch.Generator:
        """A fresh source of the same numbers."""
        return torch.Generator().manual_seed(self.seed)

    def mixed(self) -> contextlib.AbstractContextManager:
        """The surroundings in which networks run: products in bfloat16, or just as they are."""
        return torch.autocast("cpu", torch.bfloat16, enabled=self.precision == "bfloat16")


@dataclass(frozen=True)
class Measured:
    """How far a result is from the truth, in the unit that the case states.

    Attributes:
        error: Worst error against float64.
        bound: What it may be; infinite where only finiteness is asked for.
        nonfinite: How many results are not finite.
    """

    error: float
    bound: float
    nonfinite: int = 0

    @property
    def passed(self) -> bool:
        """Whether all is finite and within the bound."""
        return self.nonfinite == 0 and self.error <= self.bound

    @property
    def strain(self) -> float:
        """Error by bound; infinite for any error where there may be none, and for no number."""
        if math.isnan(self.error):
            return math.inf
        if self.bound:
            return self.error / self.bound
        return math.inf if self.error else 0.0


@dataclass(frozen=True)
class Outcome:
    """Result and gradients of one trial; no gradients where nothing is ever differentiated."""

    forward: Measured
    backward: Measured | None = None


@dataclass(frozen=True)
class Case:
    """One row of the table in each precision.

    Attributes:
        name: What is stressed.
        ranges: The numbers it is tried with.
        measure: From a trial to its outcome.
        rule: Unit and bound of the error, and why, in words.
        precisions: Keys of `PRECISIONS`.
        draws: Points that the table tries beyond the corners.
        examples: Points that a property test tries.
        tried: Points that the table tries instead of all corners, where those take too long.
    """

    name: str
    ranges: Mapping[str, Spread]
    measure: Callable[[Trial], Outcome]
    rule: str
    precisions: tuple[str, ...] = ("float32", "bfloat16")
    draws: int = 4
    examples: int = 12
    tried: tuple[Mapping[str, float], ...] = ()


def compare(found: Tensor, wanted: Tensor, unit: Tensor | float, bound: float) -> Measured:
    """Worst difference of two tensors.

    Args:
        found: What was computed.
        wanted: The truth, float64, of the same shape.
        unit: What an error of 1 means, of the same shape or a number; above 0.
        bound: Largest error allowed.
    """
    found = found.detach().double()
    finite = torch.isfinite(found)
    error = ((found - wanted.detach()).abs() / unit)[finite]
    worst = float(error.max()) if error.numel() else 0.0
    return Measured(worst, float(bound), int((~finite).sum()))


def finite(*results: Tensor | None) -> Measured:
    """Only whether everything is finite; missing gradients are."""
    bad = [(~torch.isfinite(each)).sum() for each in results if each is not None]
    return Measured(0.0, math.inf, int(sum(bad)))


def within_one(bound: float) -> float:
    """A bound of numbers about 1; if they may be off by as much, only finiteness is asked for."""
    return bound if bound < 1.0 else math.inf


def worst(measured: Sequence[Measured]) -> Measured:
    """The measurement that strains its bound most, with the non-finite results of all."""
    nonfinite = sum(each.nonfinite for each in measured)
    hardest = max(measured, key=lambda each: each.strain)
    return Measured(hardest.error, hardest.bound, nonfinite)


def gradients(result: Tensor, inputs: Sequence[Tensor]) -> tuple[Tensor, ...]:
    """Gradients of a number; zero for inputs that it does not depend on."""
    if not result.requires_grad:
        return tuple(torch.zeros_like(each) for each in inputs)
    return torch.autograd.grad(result, inputs, allow_unused=True, materialize_grads=True)
