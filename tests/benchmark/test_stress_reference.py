"""The slow references of the stress cases against still slower ones, and against hand numbers."""

import math

import numpy as np
import pytest
import torch

from pe_runtime.action.sequences import PlayerState
from pe_runtime.benchmark.stress_reference import (
    behind,
    exact_passage,
    gaps_of,
    shared_information,
    unexplained,
    walked_gradients,
    walked_weights,
)
from pe_runtime.benchmark.stress_rollout import DESIGNS, action_config, seeded_module, slow_rollout

TWO = math.log(2.0)


def passage(origin, direction, low=(0.0, 0.0, 0.0), high=(1.0, 1.0, 1.0), near=0.1):
    rows = [torch.tensor(each, dtype=torch.float64) for each in (origin, direction, low, high)]
    return exact_passage(*rows, near)


def test_weights_and_light_written_out():
    weights, light = walked_weights(np.array([[0.0, TWO, TWO, np.inf, 1.0]]))
    np.testing.assert_allclose(weights, [[0.0, 0.5, 0.25, 0.25, 0.0]], atol=1e-15)
    np.testing.assert_allclose(light, [[1.0, 1.0, 0.5, 0.25, 0.0]], atol=1e-15)


def test_gradients_are_slopes_of_the_weights():
    rng = np.random.default_rng(0)
    taus, towards = rng.uniform(0, 2, (1, 6)), rng.uniform(-1, 1, (1, 6))
    found = walked_gradients(taus, towards)
    for sample in range(6):
        step = 1e-6 * (np.arange(6) == sample)
        sums = [(walked_weights(taus + way * step)[0] * towards).sum() for way in (1, -1)]
        assert found[0, sample] == pytest.approx((sums[0] - sums[1]) / 2e-6, abs=1e-8)


def test_what_lies_behind_leaves_out_the_sample_itself():
    assert behind(np.array([[1.0, 2.0, 4.0]])).tolist() == [[6.0, 4.0, 0.0]]


def test_the_last_gap_is_given():
    assert gaps_of(np.array([[1.0, 1.0, 4.0]]), 1e10).tolist() == [[0.0, 3.0, 1e10]]


@pytest.mark.parametrize(
    ("origin", "direction", "wanted"),
    [
        ((-1.0, 0.5, 0.5), (1.0, 0.0, 0.0), (1.0, 2.0)),
        ((0.5, 0.5, 0.5), (0.0, 0.0, 2.0), (0.1, 0.25)),
        ((-1.0, 0.0, 0.5), (1.0, 0.0, 0.0), None),
        ((-1.0, 0.0, 0.5), (1.0, 1e-300, 0.0), (1.0, 2.0)),
        ((-1.0, 2.0, 0.5), (1.0, 0.0, 0.0), None),
        ((2.0, 0.5, 0.5), (1.0, 0.0, 0.0), None),
    ],
    ids=["through", "inside", "in a face", "hardly off a face", "beside", "behind"],
)
def test_rational_passages_by_hand(origin, direction, wanted):
    assert passage(origin, direction) == wanted


@pytest.mark.parametrize("high", [(1.0, 0.0, 1.0), (1.0, -1.0, 1.0)], ids=["flat", "inverted"])
def test_boxes_without_an_inside_are_missed(high):
    assert passage((-1.0, 0.0, 0.5), (1.0, 0.0, 0.0), high=high) is None


def test_information_by_hand():
    total, size = shared_information(np.diag([0.5, 0.5, 0.0]))
    assert total == pytest.approx(TWO) and size == pytest.approx(3 * TWO)
    assert shared_information(np.full((2, 2), 0.25))[0] == pytest.approx(0.0)


def test_unexplained_variance_by_hand():
    moves = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 2.0], [0.0, 2.0]])
    assert unexplained(np.eye(2)[[0, 0, 1, 1]], moves, 0.0).share == pytest.approx(0.0)
    assert unexplained(np.ones((4, 1)), moves, 0.0).share == pytest.approx(1.0)
    still = unexplained(np.ones((4, 1)), np.full((4, 2), 3.7), 0.0)
    assert (still.share, still.sensitivity) == (0.0, 0.0)


@pytest.mark.parametrize("design", DESIGNS)
def test_the_slow_rollout_is_the_module_in_float64_and_a_shaken_one_beside_it(design):
    config = action_config(design)
    module = seeded_module(config, 3).double()
    generator = torch.Generator().manual_seed(0)
    codes = [torch.randn(2, n, generator=generator, dtype=torch.float64) for n in (3, 3, 4)]
    start = PlayerState(*codes, torch.randn(2, generator=generator, dtype=torch.float64))
    looks = torch.linalg.qr(torch.randn(2, 3, 3, generator=generator, dtype=torch.float64)).Q
    tracks = torch.randint(4, (2, 30), generator=generator)
    now, memory = start, None
    with torch.no_grad():
        for actions in tracks.unbind(dim=1):
            step = module.step(now, actions, looks, memory)
            now, memory = step.state, step.memory
    weights = {name: each.numpy() for name, each in module.dynamics.state_dict().items()}
    found = slow_rollout(weights, config, start, (tracks.numpy(), looks.numpy()), 1e-6)
    np.testing.assert_allclose(found["position"][:2], now.position.numpy(), atol=1e-9)
    np.testing.assert_allclose(found["pose"][:2], now.pose.numpy(), atol=1e-9)
    moved = np.abs(found["position"][2:] - found["position"][:2]).max()
    assert 1e-9 < moved < 1e-2
