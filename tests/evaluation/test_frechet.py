"""The Frechet distance against its closed form for Gaussians, and its invariances."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import sqrtm

from pe_runtime.evaluation.frechet import frechet_distance


def whitened(seed, samples, features):
    """Samples whose mean is exactly 0 and whose covariance exactly 1."""
    raw = np.random.default_rng(seed).normal(size=(samples, features))
    raw -= raw.mean(0)
    root = np.linalg.cholesky(np.cov(raw, rowvar=False))
    return raw @ np.linalg.inv(root).T


def test_gaussians_of_known_mean_and_spread_have_the_distance_of_the_closed_form():
    # Diagonal covariances: |m|^2 + sum (s - t)^2.
    a, b = whitened(0, 200, 3), whitened(1, 150, 3)
    spread_a, spread_b, shift = np.array([1.0, 2, 3]), np.array([2.0, 2, 1]), np.array([1.0, 0, -2])
    distance = frechet_distance(a * spread_a, b * spread_b + shift)
    assert distance == pytest.approx(5 + 1 + 0 + 4, abs=1e-9)


def test_it_agrees_with_a_general_matrix_root_where_covariances_do_not_commute():
    rng = np.random.default_rng(2)
    a, b = rng.normal(size=(300, 5)) @ rng.normal(size=(5, 5)), rng.normal(size=(300, 5))
    cov_a, cov_b = np.cov(a, rowvar=False), np.cov(b, rowvar=False)
    expected = ((a.mean(0) - b.mean(0)) ** 2).sum()
    expected += np.trace(cov_a + cov_b - 2 * sqrtm(cov_a @ cov_b).real)
    assert frechet_distance(a, b) == pytest.approx(expected)


@given(seed=st.integers(0, 99), shift=st.floats(-5, 5))
def test_it_is_symmetric_zero_for_equal_sets_and_the_squared_shift_for_shifted_ones(seed, shift):
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(20, 4)), rng.normal(size=(15, 4))
    assert frechet_distance(a, a) == pytest.approx(0, abs=1e-9)
    assert frechet_distance(a, a + shift) == pytest.approx(4 * shift**2, abs=1e-8)
    assert frechet_distance(a, b) == pytest.approx(frechet_distance(b, a))


def test_fewer_samples_than_features_are_measured_all_the_same():
    rng = np.random.default_rng(3)
    distance = frechet_distance(rng.normal(size=(5, 32)), rng.normal(size=(6, 32)))
    assert math.isfinite(distance)
    assert distance > 0


def test_a_single_feature_and_a_single_sample():
    a, b = np.array([[0.0], [2.0]]), np.array([[5.0], [5.0]])
    assert frechet_distance(a, b) == pytest.approx(16 + 2)
    assert math.isnan(frechet_distance(a[:1], b))
