"""Windows of poses, and how far apart two sets of them are."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pe_runtime.action.sampling import Noise
from pe_runtime.training.likeness import BANDWIDTHS, discrepancy, pose_windows


def noise(seed=0):
    return Noise(torch.Generator().manual_seed(seed))


def slow_discrepancy(x, y):
    """The kernels themselves, pair by pair, in float64."""
    x, y = x.double(), y.double()
    median = torch.cdist(x[:128], x[:128]).median()
    total = 0.0
    for share in BANDWIDTHS:

        def kernel(a, b, width=float(share * median)):
            return torch.exp(-torch.cdist(a, b).square() / (2 * width**2)).mean()

        total += float(kernel(x, x) - 2 * kernel(x, y) + kernel(y, y))
    return total


def vectors(count, columns=5, seed=0, shift=0.0, scale=1.0):
    generator = torch.Generator().manual_seed(seed)
    return scale * torch.randn(count, columns, generator=generator) + shift


@pytest.mark.parametrize(("shift", "scale"), [(1.0, 1.0), (0.0, 0.05), (0.5, 2.0)])
def test_random_frequencies_estimate_the_kernels(shift, scale):
    x, y = vectors(90), vectors(70, seed=1, shift=shift, scale=scale)
    found = sum(float(discrepancy(x, y, noise(seed))) for seed in range(40)) / 40
    assert found == pytest.approx(slow_discrepancy(x, y), rel=0.05)


def test_a_set_does_not_differ_from_itself():
    x = vectors(50)
    assert float(discrepancy(x, x[torch.randperm(50)], noise())) < 1e-10


@given(st.floats(1e-6, 1e6))
def test_the_unit_of_the_codes_does_not_matter(unit):
    x, y = vectors(40), vectors(40, seed=1, shift=1.0)
    plain, scaled = discrepancy(x, y, noise()), discrepancy(unit * x, unit * y, noise())
    if unit > 1e-4:
        assert float(scaled) == pytest.approx(float(plain), rel=1e-2, abs=1e-4)
    assert math.isfinite(float(scaled))


def test_poses_that_stand_are_pulled_apart_by_the_gradient():
    x = vectors(64)
    y = (0.01 * vectors(64, seed=1)).requires_grad_()
    discrepancy(x, y, noise()).backward()
    # A step down the gradient spreads them.
    assert (y - 0.5 * y.grad).detach().var() > y.detach().var()


@pytest.mark.parametrize("rows", [(0, 4), (4, 0), (0, 0)])
def test_nothing_to_compare_costs_nothing(rows):
    x, y = (vectors(count).requires_grad_() for count in rows)
    loss = discrepancy(x, y, noise())
    loss.backward()
    assert float(loss.detach()) == 0


def test_equal_windows_have_a_finite_gradient():
    x, y = torch.ones(6, 3), torch.zeros(6, 3, requires_grad=True)
    discrepancy(x, y, noise()).backward()
    assert torch.isfinite(y.grad).all()


def test_a_window_holds_a_pose_its_changes_and_the_actions():
    poses = torch.arange(5.0)[None, :, None].square()
    actions = torch.eye(4)[None]
    windows = pose_windows(poses, actions, 3, 2.0)
    assert windows.shape == (3, 1 + 2 + 2 * 4)
    expected = [1.0, 3.0, 5.0, *(2 * torch.eye(4)[1]), *(2 * torch.eye(4)[2])]
    assert windows[1].tolist() == expected


def test_sequences_shorter_than_a_window_have_none():
    windows = pose_windows(torch.zeros(2, 3, 4), torch.zeros(2, 2, 5), 4, 1.0)
    assert windows.shape == (0, 4 * 4 + 3 * 5)
