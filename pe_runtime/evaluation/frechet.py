"""Frechet distance of two sets of features, each taken as a Gaussian."""

import math

import numpy as np
from jaxtyping import Float


def frechet_distance(
    a: Float[np.ndarray, "samples_a features"], b: Float[np.ndarray, "samples_b features"]
) -> float:
    """|m_a - m_b|^2 + tr(S_a + S_b - 2 (S_a^1/2 S_b S_a^1/2)^1/2) in float64.

    The roots come from eigenvalues of symmetric matrices, which exist however few samples there
    are, and need no general matrix root; rounding below zero is cut off.

    Returns:
        At least 0; NaN if a set has fewer than two samples.
    """
    if min(len(a), len(b)) < 2:
        return math.nan
    a, b = a.astype(np.float64), b.astype(np.float64)
    shift = a.mean(0) - b.mean(0)
    cov_a, cov_b = np.cov(a, rowvar=False), np.cov(b, rowvar=False)
    cov_a, cov_b = np.atleast_2d(cov_a), np.atleast_2d(cov_b)
    values, vectors = np.linalg.eigh(cov_a)
    root = (vectors * np.sqrt(np.clip(values, 0.0, None))) @ vectors.T
    shared = np.linalg.eigvalsh(root @ cov_b @ root)
    overlap = np.sqrt(np.clip(shared, 0.0, None)).sum()
    return max(0.0, float(shift @ shift + np.trace(cov_a) + np.trace(cov_b) - 2.0 * overlap))
