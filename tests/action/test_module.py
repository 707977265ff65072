import pytest
import torch
from synthetic_states import make_states

from pe_runtime.action.module import ActionModule, Sampling
from pe_runtime.action.sequences import PlayerState
from pe_runtime.config import ActionConfig

SMALL = ActionConfig(actions=5, hidden=16, variability=3, dynamics_width=24)


@pytest.fixture
def module():
    torch.manual_seed(0)
    return ActionModule(SMALL, 16, 16)


def sampling(teacher_forcing=0.5, variability=0.5, seed=0):
    return Sampling(1.0, teacher_forcing, variability, torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("batch", [1, 3])
@pytest.mark.parametrize("steps", [1, 2, 7])
def test_reconstruction_starts_at_the_encoded_state_and_keeps_the_length(module, batch, steps):
    sequence = make_states(batch, steps=steps).dataset.sequences()
    rebuilt = module.reconstruct(sequence, sampling())
    assert rebuilt.sequence.positions.shape == sequence.positions.shape
    assert torch.equal(rebuilt.sequence.poses[:, 0], sequence.poses[:, 0])
    assert rebuilt.moves.shape == (batch, steps - 1, 2)
    assert rebuilt.actions.shape == (batch, steps - 1, 5)


def test_the_same_generator_state_gives_the_same_reconstruction(module):
    sequence = make_states(3).dataset.sequences()
    first = module.reconstruct(sequence, sampling(seed=4))
    again = module.reconstruct(sequence, sampling(seed=4))
    other = module.reconstruct(sequence, sampling(seed=5))
    assert torch.equal(first.sequence.poses, again.sequence.poses)
    assert not torch.equal(first.sequence.poses, other.sequence.poses)


def test_full_teacher_forcing_steps_from_every_encoded_state(module):
    sequence = make_states(3).dataset.sequences()
    rebuilt = module.reconstruct(sequence, sampling(teacher_forcing=1.0))
    steps = (rebuilt.sequence.positions[:, 1:] - sequence.positions[:, :-1])[..., :2]
    assert torch.allclose(steps.norm(dim=-1), rebuilt.moves.norm(dim=-1), atol=1e-5)


def test_without_teacher_forcing_or_variability_reconstruction_is_play(module):
    sequence = make_states(3).dataset.sequences()
    rebuilt = module.reconstruct(sequence, sampling(teacher_forcing=0.0, variability=0.0))
    actions = rebuilt.actions.argmax(-1)
    played = module.play(sequence.at(0), actions, sequence.world_from_camera)
    assert torch.allclose(rebuilt.sequence.positions, played.positions, atol=1e-5)
    assert torch.allclose(rebuilt.sequence.poses, played.poses, atol=1e-5)


def test_step_after_step_equals_play(module):
    sequence = make_states(2).dataset.sequences()
    actions = torch.randint(5, (2, 11), generator=torch.Generator().manual_seed(0))
    played = module.play(sequence.at(0), actions, sequence.world_from_camera)
    now, memory = sequence.at(0), None
    for t in range(11):
        step = module.step(now, actions[:, t], sequence.world_from_camera[:, t], memory)
        now, memory = step.state, step.memory
    assert torch.equal(now.position, played.positions[:, -1])


def test_inferred_actions_are_indices_of_actions(module):
    labels = module.infer(make_states(3).dataset.sequences())
    assert labels.shape == (3, 11)
    assert 0 <= labels.min() and labels.max() < 5


def test_a_single_state_has_no_actions(module):
    assert module.infer(make_states(3, steps=1).dataset.sequences()).shape == (3, 0)


def test_a_misshapen_state_is_refused_by_its_annotations():
    with pytest.raises(TypeError):
        PlayerState(torch.zeros(2, 3), torch.zeros(2, 4), torch.zeros(3, 4))
