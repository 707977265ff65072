import pytest
import torch
from synthetic_states import make_states

from pe_runtime.action.discriminator import TemporalDiscriminator
from pe_runtime.action.sequences import StateSequence
from pe_runtime.config import ActionConfig


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
