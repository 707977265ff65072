import dataclasses

import pytest
import torch
from synthetic_states import make_states

from pe_runtime.action.discriminator import TemporalDiscriminator
from pe_runtime.action.sequences import StateSequence
from pe_runtime.config import ActionConfig
from pe_runtime.contract.errors import ConfigError


@pytest.fixture
def network():
    torch.manual_seed(0)
    return TemporalDiscriminator(ActionConfig(discriminator_width=16), 16)


@pytest.mark.parametrize("batch", [1, 3])
@pytest.mark.parametrize("steps", [1, 2, 12])
def test_a_sequence_of_any_length_gets_one_logit(network, batch, steps):
    sequence = make_states(batch, steps=steps).dataset.sequences()
    assert network(sequence).shape == (batch,)


def test_every_parameter_gets_a_gradient(network):
    network(make_states(3).dataset.sequences()).square().sum().backward()
    without = [n for n, p in network.named_parameters() if p.grad is None or not p.grad.any()]
    assert not without


def test_every_layer_stretches_at_most_by_one(network):
    sequence = make_states(3).dataset.sequences()
    for _ in range(50):
        network(sequence)
    network.eval()
    for layer in [*network.layers, network.score]:
        assert torch.linalg.matrix_norm(layer.weight.flatten(1), 2) < 1.01


def test_the_order_of_states_matters(network):
    network.eval()
    sequence = make_states(3).dataset.sequences()
    parts = (sequence.positions, sequence.styles, sequence.poses, sequence.world_from_camera)
    backwards = StateSequence(*(each.flip(1) for each in parts))
    assert not torch.allclose(network(sequence), network(backwards), atol=1e-4)


STATES = ActionConfig(
    discriminator="states",
    discriminator_width=16,
    discriminator_scale=(2.0, 2.0, 1.0),
    actions=5,
    variability=3,
)


@pytest.fixture
def judge_of_states():
    torch.manual_seed(0)
    return TemporalDiscriminator(STATES, 16).eval()


def taken(batch, moves):
    generator = torch.Generator().manual_seed(0)
    actions = torch.softmax(torch.randn(batch, moves, 5, generator=generator), dim=-1)
    return actions, torch.randn(batch, moves, 3, generator=generator)


@pytest.mark.parametrize("steps", [1, 2, 12])
def test_a_judge_of_states_reads_what_was_done_too(judge_of_states, steps):
    sequence = make_states(2, steps=steps).dataset.sequences()
    actions, directions = taken(2, steps - 1)
    found = judge_of_states(sequence, actions, directions)
    assert found.shape == (2,)
    if steps > 1:
        assert not torch.allclose(found, judge_of_states(sequence, actions.flip(-1), directions))
    with pytest.raises(ConfigError, match="actions and directions"):
        judge_of_states(sequence)


def test_judging_changes_states_and_never_actions(judge_of_states):
    sequence = make_states(2, steps=4).dataset.sequences()
    sequence.poses.requires_grad_(True)
    actions, directions = (each.requires_grad_(True) for each in taken(2, 3))
    judge_of_states(sequence, actions, directions).sum().backward()
    assert sequence.poses.grad.any()
    assert actions.grad is None and directions.grad is None


def test_steps_that_do_not_count_are_neither_seen_nor_averaged(judge_of_states):
    sequence = make_states(2, steps=9).dataset.sequences()
    valid = torch.ones(2, 9, dtype=torch.bool)
    valid[1, 5:] = False
    elsewhere = dataclasses.replace(sequence, poses=sequence.poses.clone())
    elsewhere.poses[1, 5:] += 7.0
    actions, directions = taken(2, 8)
    first = judge_of_states(sequence, actions, directions, valid)
    second = judge_of_states(elsewhere, actions, directions, valid)
    everything = judge_of_states(sequence, actions, directions)
    assert torch.equal(first, second)
    assert torch.allclose(first[0], everything[0], atol=1e-6)
    assert not torch.allclose(first[1], everything[1], atol=1e-4)


def test_the_mean_over_time_of_a_judge_of_states_divides_by_one_more(judge_of_states):
    with torch.no_grad():
        for layer in [*judge_of_states.layers, judge_of_states.score]:
            layer.bias.zero_()
        judge_of_states.layers[2].bias.fill_(1.0)
        weight = judge_of_states.score.weight.sum().item()
    # Every step gives ones, so the mean of T steps is T / (T + 1).
    found = judge_of_states.judge(torch.zeros(1, 4, 27)).item()
    assert found == pytest.approx(weight * 4 / 5, abs=1e-5)
