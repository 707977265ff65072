import math

import pytest
import torch
from synthetic_states import make_states

from pe_runtime.action.sequences import StateSequence
from pe_runtime.training.action_losses import (
    code_loss,
    discriminator_loss,
    generator_loss,
    heading_loss,
    joint_probabilities,
    mutual_information,
    position_loss,
    soft_delta_mse,
    variability_divergence,
)


def probabilities(samples, actions, seed, sharpness=1.0):
    generator = torch.Generator().manual_seed(seed)
    logits = torch.randn(samples, actions, generator=generator, dtype=torch.float64)
    return torch.softmax(sharpness * logits, dim=-1)


def vectors(*shape, seed=0):
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(*shape, generator=generator, dtype=torch.float64)


def shared(p, q):
    return mutual_information(joint_probabilities(p, q))


def slow_mutual_information(p, q):
    samples, actions = p.shape
    joint = [[0.0] * actions for _ in range(actions)]
    for n in range(samples):
        for i in range(actions):
            for j in range(actions):
                joint[i][j] += p[n, i].item() * q[n, j].item() / samples / 2
                joint[j][i] += p[n, i].item() * q[n, j].item() / samples / 2
    margin = [sum(row) for row in joint]
    total = 0.0
    for i in range(actions):
        for j in range(actions):
            if joint[i][j] > 0:
                total += joint[i][j] * math.log(joint[i][j] / (margin[i] * margin[j]))
    return total


def slow_soft_delta_mse(p, moves, slack=0.0):
    samples, actions = p.shape
    total = 0.0
    for k in range(actions):
        mass = sum(p[j, k].item() for j in range(samples))
        if mass == 0.0:
            continue
        centre = sum(p[j, k].item() * moves[j] for j in range(samples)) / (mass + slack)
        for j in range(samples):
            total += p[j, k].item() * ((moves[j] - centre) ** 2).sum().item()
    mean = sum(moves[j] for j in range(samples)) / samples
    variance = sum(((moves[j] - mean) ** 2).sum().item() for j in range(samples)) / samples
    return total / samples / (variance + moves.shape[1] * slack)


def slow_divergence(mean, log_variance):
    total = 0.0
    for m, lv in zip(mean, log_variance, strict=True):
        for a, b in zip(m.tolist(), lv.tolist(), strict=True):
            total += 0.5 * (a * a + math.exp(b) - b - 1)
    return total / len(mean)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("sharpness", [0.1, 1.0, 30.0])
def test_mutual_information_agrees_with_its_slow_twin(seed, sharpness):
    p, q = probabilities(9, 4, seed, sharpness), probabilities(9, 4, seed + 50, sharpness)
    assert math.isclose(shared(p, q), slow_mutual_information(p, q), abs_tol=1e-9)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("slack", [0.0, 0.3])
def test_soft_delta_mse_agrees_with_its_slow_twin(seed, slack):
    p, moves = probabilities(9, 4, seed, 3.0), vectors(9, 2, seed=seed)
    expected = slow_soft_delta_mse(p, moves, slack)
    assert math.isclose(soft_delta_mse(p, moves, slack), expected, rel_tol=1e-9)


def test_divergence_agrees_with_its_slow_twin():
    mean, log_variance = vectors(6, 3), vectors(6, 3, seed=1)
    expected = slow_divergence(mean, log_variance)
    assert math.isclose(variability_divergence(mean, log_variance), expected, rel_tol=1e-12)


def test_a_standard_normal_has_no_divergence():
    assert variability_divergence(torch.zeros(2, 3, 4), torch.zeros(2, 3, 4)) == 0.0


def test_equal_and_frequent_actions_share_the_logarithm_of_their_number():
    actions = torch.eye(4, dtype=torch.float64).repeat(3, 1)
    assert math.isclose(shared(actions, actions), math.log(4), rel_tol=1e-9)


def test_a_constant_action_shares_nothing():
    actions = torch.eye(4, dtype=torch.float64)[[1, 1, 1]]
    assert math.isclose(shared(actions, actions), 0.0, abs_tol=1e-9)


def test_mutual_information_is_symmetric():
    p, q = probabilities(9, 4, 0, 4.0), probabilities(9, 4, 1, 4.0)
    assert math.isclose(shared(p, q), shared(q, p), rel_tol=1e-12)


@pytest.mark.parametrize("rows", [[0, 1, 2], [0, 0, 0], [2]])
def test_one_hot_and_zero_probabilities_have_finite_values_and_gradients(rows):
    p = torch.eye(4)[rows].requires_grad_(True)
    q = torch.eye(4)[rows[::-1]].requires_grad_(True)
    moves = torch.randn(len(rows), 2, generator=torch.Generator().manual_seed(0))
    value = shared(p, q) + soft_delta_mse(p, moves)
    value.backward()
    assert torch.isfinite(value)
    assert torch.isfinite(p.grad).all() and torch.isfinite(q.grad).all()


def test_a_running_joint_remembers_without_a_gradient():
    p, q = probabilities(9, 4, 0).requires_grad_(True), probabilities(9, 4, 1)
    running = torch.full((4, 4), 1 / 16, dtype=torch.float64, requires_grad=True)
    joint = joint_probabilities(p, q, running, 0.8)
    assert torch.allclose(joint, 0.8 / 16 + 0.2 * joint_probabilities(p, q))
    assert math.isclose(joint.sum().item(), 1.0, rel_tol=1e-9)
    mutual_information(joint).backward()
    assert p.grad.any() and running.grad is None


def test_headings_differ_by_their_sines_and_cosines_after_the_first():
    encoded = torch.tensor([[0.0, 0.5, 1.0]], dtype=torch.float64)
    assert math.isclose(heading_loss(encoded + math.tau, encoded), 0.0, abs_tol=1e-20)
    opposite = encoded + torch.tensor([[3.0, math.pi, math.pi]])
    # Opposite directions are 2 apart, so their two coordinates differ by 4 / 2 in the mean.
    assert math.isclose(heading_loss(opposite, encoded), 2.0, rel_tol=1e-6)


def test_movements_that_are_all_equal_cost_nothing():
    p = probabilities(5, 3, 0).float().requires_grad_(True)
    value = soft_delta_mse(p, torch.full((5, 2), 0.3))
    value.backward()
    assert math.isclose(value.item(), 0.0, abs_tol=1e-3)
    assert torch.isfinite(p.grad).all()


def test_actions_that_say_all_about_movement_cost_nothing_and_one_action_costs_all():
    moves = torch.tensor([[1.0, 0], [1, 0], [0, 2], [0, 2]], dtype=torch.float64)
    exact = torch.eye(2, dtype=torch.float64)[[0, 0, 1, 1]]
    one = torch.ones(4, 1, dtype=torch.float64)
    assert math.isclose(soft_delta_mse(exact, moves), 0.0, abs_tol=1e-12)
    assert math.isclose(soft_delta_mse(one, moves), 1.0, rel_tol=1e-12)


def test_no_samples_give_zero():
    nothing = torch.zeros(0, 3)
    assert shared(nothing, nothing) == 0.0
    assert soft_delta_mse(nothing, torch.zeros(0, 2)) == 0.0
    assert variability_divergence(torch.zeros(2, 0, 3), torch.zeros(2, 0, 3)) == 0.0


@pytest.mark.parametrize("steps", [1, 2, 6])
def test_reconstruction_counts_all_states_but_the_first(steps):
    encoded = make_states(2, steps=steps).dataset.sequences()
    moved = encoded.positions.clone()
    moved[:, 0] += 100.0
    moved[:, 1:, :2] += 0.3
    other = StateSequence(moved, encoded.styles, encoded.poses, encoded.world_from_camera)
    expected = 0.0 if steps == 1 else 1.0
    assert math.isclose(position_loss(other, encoded, 0.3), expected, abs_tol=1e-4)
    assert math.isclose(code_loss(encoded.poses + 2.0, encoded.poses), 4.0 * expected, abs_tol=1e-4)


def test_the_discriminator_is_happiest_when_it_is_right():
    real, fake = torch.tensor([9.0, 8.0]), torch.tensor([-9.0, -8.0])
    assert discriminator_loss(real, fake) < 1e-3 < discriminator_loss(fake, real)
    assert generator_loss(real) < 1e-3 < generator_loss(fake)
    even = torch.zeros(2)
    assert math.isclose(discriminator_loss(even, even), 2 * math.log(2), rel_tol=1e-6)


def test_logits_of_a_thousand_stay_finite():
    logits = torch.tensor([1e3, -1e3], requires_grad=True)
    (discriminator_loss(logits, logits) + generator_loss(logits)).backward()
    assert torch.isfinite(logits.grad).all()


@pytest.mark.parametrize("step", [0.3, 37.3, 1234.5, 1e6])
@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_movements_that_are_all_equal_cost_nothing_however_long_they_are(step, dtype):
    p = probabilities(7, 3, 0).to(dtype)
    assert soft_delta_mse(p, torch.full((7, 2), step, dtype=dtype)).item() < 1e-3


def test_a_horizon_makes_late_differences_count_less():
    encoded, rebuilt = torch.zeros(2, 4, 3), torch.ones(2, 4, 3)
    found = code_loss(rebuilt, encoded, horizon=2.0)
    expected = sum(math.exp(-age / 2) for age in range(3)) / 3
    assert float(found) == pytest.approx(expected)
