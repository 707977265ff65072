"""A figure with the interval that resampled sequences put around it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pe_runtime.evaluation.rules import RULES

RESAMPLES = RULES.resamples


@dataclass(frozen=True)
class Figure:
    """A measured value and its 95 % bootstrap interval over sequences.

    Attributes:
        value: From all sequences; NaN if there was nothing to measure.
        low: 2.5 % point of the resampled values.
        high: 97.5 % point.
        sequences: How many sequences it rests on.
    """

    value: float
    low: float
    high: float
    sequences: int


def bootstrap(
    sequences: Sequence[Any], measure: Callable[[Sequence[Any]], float], seed: int = RULES.seed
) -> Figure:
    """Measure all sequences, then sets of as many drawn from them with replacement.

    Sequences are the unit: frames of one sequence are too alike to count as independent.

    Args:
        sequences: Whatever `measure` takes, one entry a sequence.
        measure: The figure of a set of sequences; NaN for "cannot be told".
        seed: Of the draws; the same seed gives the same interval.
    """
    count = len(sequences)
    if count == 0:
        return Figure(math.nan, math.nan, math.nan, 0)
    draws = np.random.default_rng(seed).integers(0, count, size=(RESAMPLES, count))
    values = np.array([measure([sequences[i] for i in draw]) for draw in draws])
    values = values[~np.isnan(values)]
    low, high = np.percentile(values, [2.5, 97.5]) if values.size else (math.nan, math.nan)
    return Figure(float(measure(sequences)), float(low), float(high), count)


def bootstrap_mean(values: Sequence[float], seed: int = RULES.seed) -> Figure:
    """The mean of one value per sequence; sequences whose value is NaN are left out."""
    told = [value for value in values if not math.isnan(value)]
    return bootstrap(told, lambda drawn: float(np.mean(drawn)), seed)
