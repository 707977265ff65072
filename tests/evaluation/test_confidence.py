"""Bootstrap intervals."""

import math

import numpy as np
import pytest

from pe_runtime.evaluation.confidence import bootstrap, bootstrap_mean


def test_the_interval_of_equal_sequences_is_a_point():
    figure = bootstrap_mean([2.0, 2.0, 2.0])
    assert (figure.value, figure.low, figure.high, figure.sequences) == (2.0, 2.0, 2.0, 3)


def test_the_interval_is_about_two_standard_errors_wide_on_each_side():
    values = np.random.default_rng(0).normal(10.0, 1.0, size=100).tolist()
    figure = bootstrap_mean(values)
    assert figure.low < figure.value < figure.high
    assert figure.high - figure.low == pytest.approx(4 * 0.1, rel=0.25)


def test_the_same_seed_draws_the_same_interval():
    assert bootstrap_mean([1.0, 5.0, 2.0]) == bootstrap_mean([1.0, 5.0, 2.0])


def test_sequences_without_a_value_are_left_out():
    assert bootstrap_mean([1.0, math.nan, 3.0]).value == 2.0
    assert bootstrap_mean([1.0, math.nan, 3.0]).sequences == 2


def test_nothing_measured_is_not_zero():
    figure = bootstrap_mean([math.nan])
    assert math.isnan(figure.value)
    assert math.isnan(figure.low)
    assert figure.sequences == 0


def test_draws_that_cannot_be_measured_do_not_spoil_the_interval():
    def spread(drawn):
        return max(drawn) - min(drawn) if len(set(drawn)) > 1 else math.nan

    figure = bootstrap([1.0, 2.0], spread)
    assert (figure.value, figure.low, figure.high) == (1.0, 1.0, 1.0)
