import dataclasses
import math

import pytest
import torch
from synthetic_states import make_states

from pe_runtime.action.sampling import Noise, Sampling
from pe_runtime.action.state_action_network import StateActionNetwork, followed_centroids
from pe_runtime.config import ActionConfig

SMALL = ActionConfig(design="state", actions=5, hidden=16, variability=3, sees_heading=True)


@pytest.fixture
def network():
    torch.manual_seed(0)
    return StateActionNetwork(SMALL)


@pytest.fixture(scope="module")
def sequence():
    whole = make_states(4).dataset.sequences()
    headings = torch.randn(4, 12, generator=torch.Generator().manual_seed(0))
    return dataclasses.replace(whole, headings=headings)


def noise(seed=0):
    return Noise(torch.Generator().manual_seed(seed))


def first_steps(sequence, steps):
    parts = dataclasses.fields(sequence)
    return type(sequence)(*(getattr(sequence, part.name)[:, :steps] for part in parts))


@pytest.mark.parametrize("steps", [1, 2, 12])
def test_there_is_one_estimate_per_transition(network, sequence, steps):
    estimate = network(first_steps(sequence, steps), noise())
    assert estimate.logits.shape == (4, steps - 1, 5)
    assert estimate.direction.shape == estimate.log_variance.shape == (4, steps - 1, 3)


def test_directions_are_differences_of_points_with_the_sum_of_their_variances(network, sequence):
    """A slow twin of the embedding of two states, in numbers of Python."""
    estimate = network.double()(doubled(sequence))
    for t in range(3):
        (m0, lv0), (m1, lv1) = (embedded(network, sequence, 1, t + k) for k in (0, 1))
        mean = [b - a for a, b in zip(m0, m1, strict=True)]
        spread = [math.log(math.exp(a) + math.exp(b)) for a, b in zip(lv0, lv1, strict=True)]
        assert estimate.mean[1, t].tolist() == pytest.approx(mean, abs=1e-9)
        assert estimate.log_variance[1, t].tolist() == pytest.approx(spread, abs=1e-9)


def doubled(sequence):
    parts = dataclasses.fields(sequence)
    return type(sequence)(*(getattr(sequence, part.name).double() for part in parts))


def embedded(network, sequence, batch, t):
    place = sequence.positions[batch, t].tolist()
    values = [x / s for x, s in zip(place, SMALL.position_scale, strict=True)]
    heading = sequence.headings[batch, t].item()
    values += [math.sin(heading), math.cos(heading)]
    for layer in (network.first, network.second, network.third):
        values = [max(0.0, x) for x in applied(layer, values)]
    return applied(network.mean, values), applied(network.log_variance, values)


def applied(layer, values):
    rows = zip(layer.weight.tolist(), layer.bias.tolist(), strict=True)
    return [b + sum(w * x for w, x in zip(row, values, strict=True)) for row, b in rows]


def test_without_noise_the_direction_is_its_mean(network, sequence):
    estimate = network(sequence)
    assert torch.equal(estimate.direction, estimate.mean)
    assert torch.equal(network.logits(estimate.mean), estimate.logits)


def test_drawn_directions_have_the_estimated_mean_and_spread(network, sequence):
    estimate, drawing = network(sequence), noise()
    with torch.no_grad():
        drawn = torch.stack([network(sequence, drawing).direction for _ in range(2000)])
    assert torch.allclose(drawn.mean(0), estimate.mean, atol=0.15)
    assert torch.allclose(drawn.std(0), torch.exp(0.5 * estimate.log_variance), rtol=0.1)


def test_styles_poses_and_cameras_are_not_looked_at(network, sequence):
    other = dataclasses.replace(
        sequence,
        styles=sequence.styles + 1,
        poses=-sequence.poses,
        world_from_camera=sequence.world_from_camera.flip(1),
    )
    assert torch.equal(network(other).logits, network(sequence).logits)
    turned = dataclasses.replace(sequence, headings=sequence.headings.flip(1))
    assert not torch.allclose(network(turned).logits, network(sequence).logits, atol=1e-4)


def test_v_is_what_the_taken_actions_leave_of_the_direction(network, sequence):
    estimate = network(sequence)
    third = torch.nn.functional.one_hot(torch.full((4, 11), 2), 5).float()
    v = network.variability(estimate, third, Sampling(1.0, 0.0, 1.0, noise()))
    assert torch.allclose(v, estimate.direction - network.centroids[2], atol=1e-6)
    mixed = 0.25 * third + 0.75 * third.roll(1, -1)
    v = network.variability(estimate, mixed, Sampling(1.0, 0.0, 1.0, noise()))
    centre = 0.25 * network.centroids[2] + 0.75 * network.centroids[3]
    assert torch.allclose(v, estimate.direction - centre, atol=1e-6)


def test_every_parameter_but_the_origin_of_the_points_gets_a_gradient(network, sequence):
    estimate = network(sequence, noise())
    (estimate.logits.square().sum() + estimate.direction.sum()).backward()
    without = [n for n, p in network.named_parameters() if p.grad is None or not p.grad.any()]
    assert without == ["mean.bias"]


def test_centroids_move_to_the_mean_directions_of_their_actions():
    centroids = torch.tensor([[1.0, 0.0], [0.0, 1.0], [5.0, 5.0]])
    p = torch.tensor([[1.0, 0.0, 0.0], [0.5, 0.5, 0.0]])
    directions = torch.tensor([[2.0, 0.0], [5.0, 3.0]])
    found = followed_centroids(centroids, p, directions, 0.1)
    # Means: (1 * 2 + 0.5 * 5) / 1.5 = 3 and 0.5 * 3 / 1.5 = 1; then (5, 3); the third is no one's.
    expected = torch.tensor([[0.9 + 0.3, 0.1], [0.5, 0.9 + 0.3], [5.0, 5.0]])
    assert torch.allclose(found, expected)


def test_positions_kilometres_away_leave_variances_and_their_gradients_finite(network, sequence):
    far = dataclasses.replace(sequence, positions=sequence.positions * 1e6)
    estimate = network(far, noise())
    spread = torch.exp(estimate.log_variance).sum() + estimate.direction.sum()
    spread.backward()
    assert torch.isfinite(spread)
    assert all(torch.isfinite(each.grad).all() for each in network.first.parameters())
