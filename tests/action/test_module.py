import pytest
import torch
from synthetic_states import make_states

from pe_runtime.action.module import ActionModule
from pe_runtime.action.sampling import Noise, Sampling
from pe_runtime.action.sequences import PlayerState
from pe_runtime.config import ActionConfig

SMALL = ActionConfig(actions=5, hidden=16, variability=3, dynamics_width=24)
TURNING = ActionConfig(
    design="state",
    actions=5,
    hidden=16,
    variability=3,
    dynamics_width=24,
    movement_frame="object",
    sees_heading=True,
    predict_heading=True,
)


@pytest.fixture(params=[SMALL, TURNING], ids=["transition", "state"])
def module(request):
    torch.manual_seed(0)
    return ActionModule(request.param, 16, 16)


def sampling(teacher_forcing=0.5, variability=0.5, seed=0, **further):
    noise = Noise(torch.Generator().manual_seed(seed))
    return Sampling(1.0, teacher_forcing, variability, noise, **further)


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


def test_the_given_states_are_stepped_from_and_no_others(module):
    sequence = make_states(3).dataset.sequences()
    rebuilt = module.reconstruct(sequence, sampling(teacher_forcing=0.0, given=4)).sequence
    forced = module.reconstruct(sequence, sampling(teacher_forcing=1.0)).sequence
    assert torch.equal(rebuilt.poses[:, :5], forced.poses[:, :5])
    assert not torch.allclose(rebuilt.positions[:, 5:], forced.positions[:, 5:], atol=1e-4)


def test_centroids_stay_unless_told_to_follow():
    torch.manual_seed(0)
    module = ActionModule(TURNING, 16, 16)
    before = module.action_network.centroids.clone()
    sequence = make_states(3).dataset.sequences()
    module.reconstruct(sequence, sampling())
    assert torch.equal(module.action_network.centroids, before)
    module.reconstruct(sequence, sampling(centroid_rate=0.1))
    assert not torch.allclose(module.action_network.centroids, before, atol=1e-4)


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
