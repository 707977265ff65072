import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pe_runtime.rendering.compositing import (
    OPAQUE,
    composite,
    exclusive_sum,
    weights_from_thickness,
)

EXTREMES = [0.0, 1e-30, 1e-8, 1e4, 1e10, 1e30, 3e38]
thicknesses = st.lists(
    st.one_of(st.sampled_from(EXTREMES), st.floats(0.0, 20.0, width=32)), min_size=1, max_size=12
)


def naive_weights(taus):
    """The definition, one sample after the other."""
    weights, transmittance = [], 1.0
    for tau in taus:
        weights.append(transmittance * -math.expm1(-tau))
        transmittance *= math.exp(-tau)
    return weights


def naive_composite(depths, taus):
    order = sorted(range(len(depths)), key=lambda i: depths[i])
    weights = [0.0] * len(depths)
    for place, weight in zip(order, naive_weights([taus[i] for i in order]), strict=True):
        weights[place] = weight
    return weights


@given(thicknesses)
def test_weights_are_shares_whatever_the_thickness(taus):
    weights = weights_from_thickness(torch.tensor([taus], dtype=torch.float32))
    assert torch.isfinite(weights).all()
    assert (weights >= 0).all()
    assert weights.sum() <= 1 + 1e-6


@given(thicknesses)
def test_weights_and_the_rest_of_the_light_make_one(taus):
    weights = weights_from_thickness(torch.tensor([taus], dtype=torch.float64))
    left_over = math.exp(-min(sum(taus), 700.0))
    assert float(weights.sum()) + left_over == pytest.approx(1.0, abs=1e-12)


@given(thicknesses)
def test_weights_agree_with_the_definition_sample_by_sample(taus):
    weights = weights_from_thickness(torch.tensor([taus], dtype=torch.float64))
    torch.testing.assert_close(
        weights[0], torch.tensor(naive_weights(taus), dtype=torch.float64), atol=1e-12, rtol=1e-9
    )


def test_float32_weights_agree_with_the_float64_definition():
    taus = torch.rand(40, 17, generator=torch.Generator().manual_seed(1)) ** 4 * 8
    wanted = torch.tensor([naive_weights(row) for row in taus.double().tolist()])
    torch.testing.assert_close(weights_from_thickness(taus), wanted, atol=1e-6, rtol=1e-5)


def test_weights_by_hand():
    two = math.log(2)
    taus = torch.tensor([[0.0, two, two, 0.0, OPAQUE, two]])
    wanted = torch.tensor([[0.0, 0.5, 0.25, 0.0, 0.25, 0.0]])
    torch.testing.assert_close(weights_from_thickness(taus), wanted)


def test_a_sample_behind_an_opaque_one_weighs_exactly_nothing():
    weights = weights_from_thickness(torch.tensor([[OPAQUE, 1.0, 1e30]]))
    assert weights.tolist() == [[1.0, 0.0, 0.0]]


def test_a_huge_last_interval_does_not_drown_the_small_ones_before_it():
    taus = torch.tensor([[0.1, 0.2, 0.3, 1e30]])
    summed_first = torch.cumsum(taus, -1) - taus
    assert summed_first[0, -1] == 0, "subtracting loses the sum, which is why it is shifted"
    assert exclusive_sum(taus)[0].tolist() == pytest.approx([0.0, 0.1, 0.3, 0.6])
    assert float(weights_from_thickness(taus)[0, -1]) == pytest.approx(math.exp(-0.6))


def test_tiny_thickness_keeps_its_digits():
    weights = weights_from_thickness(torch.tensor([[1e-30, 1e-12, 1e-10]]))
    assert weights[0].tolist() == pytest.approx([1e-30, 1e-12, 1e-10], rel=1e-6)


def test_an_infinite_thickness_takes_all_that_is_left():
    weights = weights_from_thickness(torch.tensor([[math.log(2), math.inf, 1.0]]))
    assert weights[0].tolist() == pytest.approx([0.5, 0.5, 0.0])


@given(st.data())
def test_composition_agrees_with_a_loop_over_sorted_samples(data):
    count = data.draw(st.integers(1, 10))
    # Few different depths, so that equal ones are common.
    depths = data.draw(st.lists(st.integers(0, 6).map(float), min_size=count, max_size=count))
    taus = data.draw(st.lists(st.floats(0.0, 5.0), min_size=count, max_size=count))
    weights = composite(
        torch.tensor([depths], dtype=torch.float64), torch.tensor([taus], dtype=torch.float64)
    )
    assert weights[0].tolist() == pytest.approx(naive_composite(depths, taus), abs=1e-6)


def test_gradients_agree_with_those_of_the_loop():
    generator = torch.Generator().manual_seed(3)
    depth = torch.rand(3, 8, generator=generator, dtype=torch.float64)
    taus = torch.rand(3, 8, generator=generator, dtype=torch.float64) * 3
    towards = torch.randn(3, 8, generator=generator, dtype=torch.float64)
    fast = taus.clone().requires_grad_()
    (composite(depth, fast) * towards).sum().backward()
    slow = taus.clone().requires_grad_()
    total = torch.zeros((), dtype=torch.float64)
    for ray in range(3):
        transmittance = torch.ones((), dtype=torch.float64)
        for sample in torch.argsort(depth[ray]).tolist():
            tau = slow[ray, sample]
            total = total + towards[ray, sample] * transmittance * (1 - torch.exp(-tau))
            transmittance = transmittance * torch.exp(-tau)
    total.backward()
    torch.testing.assert_close(fast.grad, slow.grad, atol=1e-6, rtol=1e-6)


@pytest.mark.parametrize("thickness", [0.0, 1e-30, 1e4, 1e30])
def test_gradients_are_finite_at_the_extremes(thickness):
    taus = torch.tensor([[0.3, thickness, 0.5, 1e30]], requires_grad=True)
    weights_from_thickness(taus).square().sum().backward()
    assert torch.isfinite(taus.grad).all()


@given(st.permutations(range(9)))
def test_the_order_in_which_objects_come_does_not_matter(order):
    generator = torch.Generator().manual_seed(5)
    depth = torch.rand(4, 9, generator=generator)
    taus = torch.rand(4, 9, generator=generator) * 2
    order = torch.tensor(order)
    shuffled = composite(depth[:, order], taus[:, order])
    assert torch.equal(shuffled, composite(depth, taus)[:, order])


def test_equal_depths_are_taken_in_the_given_order():
    taus = torch.tensor([[math.log(2), OPAQUE, OPAQUE]])
    weights = composite(torch.ones(1, 3), taus)
    assert weights[0].tolist() == pytest.approx([0.5, 0.5, 0.0])


def test_overlapping_objects_add_their_densities():
    apart = composite(torch.tensor([[1.0, 1.0, 2.0]]), torch.tensor([[0.2, 0.5, OPAQUE]]))
    joined = composite(torch.tensor([[1.0, 2.0]]), torch.tensor([[0.7, OPAQUE]]))
    assert float(apart[0, 2]) == pytest.approx(float(joined[0, 1]), rel=1e-6)


def test_no_samples_give_no_weights():
    assert composite(torch.zeros(3, 0), torch.zeros(3, 0)).shape == (3, 0)


def test_no_rays_give_no_weights():
    assert composite(torch.zeros(0, 4), torch.zeros(0, 4)).shape == (0, 4)
