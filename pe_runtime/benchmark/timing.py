"""Numbers from repeated measurements: median and spread, the order of runs, the slope of a cost."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

T = TypeVar("T")


@dataclass(frozen=True)
class Spread:
    """What repeated measurements say; quartiles, because one slow run says nothing.

    Attributes:
        median: The middle value.
        low: A quarter of the values lie below.
        high: A quarter of the values lie above.
        count: How many values there were.
    """

    median: float
    low: float
    high: float
    count: int


def spread(values: Sequence[float]) -> Spread:
    """Median and quartiles of one value or more; e.g. (1, 2, 3, 4, 9) gives 3 from 2 to 4."""
    low, median, high = np.quantile(np.asarray(values, np.float64), (0.25, 0.5, 0.75))
    return Spread(float(median), float(low), float(high), len(values))


def interleaved(things: Sequence[T], rounds: int) -> list[T]:
    """Everything once a round, each round beginning one further on.

    A machine that grows slower or faster in time does so for all of them, and none always follows
    the same other.
    """
    order = list(things)
    shifts = [number % max(1, len(order)) for number in range(rounds)]
    return [each for shift in shifts for each in order[shift:] + order[:shift]]


def log_slope(x: Sequence[float], y: Sequence[float]) -> float:
    """Exponent b of y = a x^b, fitted in logarithms; 1 means cost in proportion."""
    return float(np.polyfit(np.log(np.asarray(x)), np.log(np.asarray(y)), 1)[0])
