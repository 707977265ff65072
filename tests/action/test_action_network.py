import pytest
import torch
from synthetic_states import make_states

from pe_runtime.action.action_network import ActionNetwork
from pe_runtime.action.sampling import Noise, Sampling, sample_actions
from pe_runtime.action.sequences import StateSequence
from pe_runtime.config import ActionConfig
from pe_runtime.contract.errors import ConfigError

SMALL = ActionConfig(actions=5, hidden=16, variability=3)


def sampling(temperature=1.0, seed=0, soft=False):
    return Sampling(temperature, 0.0, 1.0, Noise(torch.Generator().manual_seed(seed)), soft)


def first_steps(sequence, steps, batch=None):
    parts = (sequence.positions, sequence.styles, sequence.poses, sequence.world_from_camera)
    return StateSequence(*(each[:batch, :steps] for each in parts))


@pytest.fixture
def network():
    torch.manual_seed(0)
    return ActionNetwork(SMALL, 16)


@pytest.fixture(scope="module")
def sequence():
    return make_states(4).dataset.sequences()


@pytest.mark.parametrize("batch", [1, 4])
@pytest.mark.parametrize("steps", [1, 2, 3, 12])
def test_there_is_one_estimate_per_transition(network, sequence, steps, batch):
    estimate = network(first_steps(sequence, steps, batch))
    assert estimate.logits.shape == (batch, steps - 1, 5)
    assert estimate.mean.shape == estimate.log_variance.shape == (batch, steps - 1, 3)
    assert torch.allclose(estimate.probabilities.sum(-1), torch.ones(batch, steps - 1))


def test_every_parameter_gets_a_gradient(network, sequence):
    estimate = network(sequence)
    (estimate.logits.square().sum() + estimate.mean.sum() + estimate.log_variance.sum()).backward()
    without = [n for n, p in network.named_parameters() if p.grad is None or not p.grad.any()]
    assert not without


def test_turning_the_world_with_its_cameras_changes_nothing(network, sequence):
    turn = torch.tensor([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]])
    turned = StateSequence(
        sequence.positions @ turn.T,
        sequence.styles,
        sequence.poses,
        turn @ sequence.world_from_camera,
    )
    assert torch.allclose(network(turned).logits, network(sequence).logits, atol=1e-4)


def test_actions_do_not_depend_on_place_or_style(network, sequence):
    elsewhere = StateSequence(
        sequence.positions + torch.tensor([3.0, -2.0, 0.0]),
        sequence.styles * 2,
        sequence.poses,
        sequence.world_from_camera,
    )
    assert torch.allclose(network(elsewhere).logits, network(sequence).logits, atol=1e-4)


def test_a_window_of_one_sees_only_its_own_two_states(sequence):
    network = ActionNetwork(ActionConfig(window=1), 16)
    pair = first_steps(sequence, 2)
    assert torch.allclose(network(pair).logits[:, 0], network(sequence).logits[:, 0], atol=1e-6)


def test_a_box_cut_for_one_frame_moves_distant_logits_not_at_all(network, sequence):
    positions = sequence.positions.clone()
    positions[:, 9] += 1e6
    thrown = StateSequence(positions, sequence.styles, sequence.poses, sequence.world_from_camera)
    before, after = network(sequence).logits, network(thrown).logits
    assert torch.isfinite(after).all()
    assert torch.equal(before[:, :6], after[:, :6])


@pytest.mark.parametrize("window", [0, 2, -1])
def test_a_window_must_have_a_middle(window):
    with pytest.raises(ConfigError, match="odd"):
        ActionNetwork(ActionConfig(window=window), 16)


def test_sampled_actions_are_one_hot_and_carry_gradients():
    logits = torch.randn(6, 4, 5, requires_grad=True)
    actions = sample_actions(logits, sampling(0.5, seed=1))
    assert torch.allclose(actions.sum(-1), torch.ones(6, 4))
    assert torch.allclose(actions.max(-1).values, torch.ones(6, 4))
    (actions * torch.randn(6, 4, 5)).sum().backward()
    assert torch.isfinite(logits.grad).all() and logits.grad.any()


def test_sampled_actions_follow_their_probabilities():
    logits = torch.tensor([0.5, 0.3, 0.2]).log().expand(20000, 3)
    share = sample_actions(logits, sampling()).mean(0)
    assert torch.allclose(share, torch.tensor([0.5, 0.3, 0.2]), atol=0.02)


def test_softly_sampled_actions_are_mixtures_around_the_hard_ones():
    logits = torch.randn(50, 5, generator=torch.Generator().manual_seed(0))
    hard, soft = (sample_actions(logits, sampling(seed=3, soft=soft)) for soft in (False, True))
    assert torch.allclose(soft.sum(-1), torch.ones(50))
    assert torch.equal(hard.argmax(-1), soft.argmax(-1))
    assert soft.max(-1).values.min() < 0.9


@pytest.mark.parametrize("temperature", [1e-3, 1.0, 100.0])
def test_extreme_logits_sample_without_nan(temperature):
    logits = torch.tensor([[1e4, -1e4, 0.0], [0.0, 0.0, 0.0]], requires_grad=True)
    actions = sample_actions(logits, sampling(temperature))
    actions.square().sum().backward()
    assert torch.isfinite(actions).all() and torch.isfinite(logits.grad).all()


def test_variability_has_the_estimated_mean_and_spread(network, sequence):
    estimate = network(sequence)
    actions, drawing = estimate.probabilities, sampling()
    drawn = [network.variability(estimate, actions, drawing) for _ in range(2000)]
    drawn = torch.stack(drawn)
    spread = torch.exp(0.5 * estimate.log_variance)
    assert torch.allclose(drawn.mean(0), estimate.mean, atol=0.15)
    assert torch.allclose(drawn.std(0), spread, rtol=0.1)
