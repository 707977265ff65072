import dataclasses
import math

import pytest
import torch
from synthetic_states import make_states

from pe_runtime.action.description import (
    KnownActions,
    describe_actions,
    describe_by_rollout,
    neutral_starts,
)
from pe_runtime.action.module import ActionModule
from pe_runtime.action.sequences import StateSequence
from pe_runtime.config import ActionConfig


class Scripted(ActionModule):
    """Says the actions it was given."""

    def __init__(self, labels, actions):
        super().__init__(ActionConfig(actions=actions, hidden=4, dynamics_width=4), 1, 1)
        self.labels = labels

    def infer(self, sequence):
        return self.labels


EIGHT = ["right", "forward-right", "forward", "forward-left", "left", "back-left", "back"]
EIGHT += ["back-right"]


def described(labels, moves, poses=None, known=None):
    """Describe given labels of one sequence that makes the given movements."""
    count = int(max(labels)) + 1
    steps = torch.tensor([[x, y, 0.0] for x, y in moves])
    positions = torch.cat([torch.zeros(1, 3), steps.cumsum(0)])[None]
    time = positions.shape[1]
    poses = torch.zeros(1, time, 2) if poses is None else poses
    looks_along_y = torch.tensor([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    sequence = StateSequence(
        positions, torch.zeros(1, time, 1), poses, looks_along_y.expand(1, time, 3, 3)
    )
    return describe_actions(Scripted(torch.tensor([list(labels)]), count), sequence, known)


def test_the_eight_directions_are_named():
    angles = [k * math.pi / 4 for k in range(8)]
    found = described(range(8), [(math.cos(a), math.sin(a)) for a in angles])
    assert [each.name for each in found] == EIGHT


def test_names_are_unique_and_shares_sum_to_one():
    found = described([0, 1, 2, 2], [(-1, 0), (-0.8, 0.1), (0, 0), (0, 0)])
    assert [each.name for each in found] == ["left", "left-2", "stay"]
    assert [each.share for each in found] == [0.25, 0.25, 0.5]
    assert math.isclose(found[0].movement[0], -1.0, rel_tol=1e-6)


def test_a_standing_action_with_another_pose_is_a_gesture():
    poses = torch.zeros(1, 5, 2)
    poses[0, 4] = 5.0
    found = described([0, 0, 1, 2], [(1, 0), (1, 0), (0, 0), (0.01, 0)], poses)
    assert [each.name for each in found] == ["right", "stay", "gesture"]


def test_an_action_never_taken_is_unused():
    found = described([0, 3], [(1, 0), (0, 1)])
    assert [each.name for each in found] == ["right", "unused", "unused-2", "forward"]
    assert found[1].share == 0.0


def test_standing_actions_take_the_true_name_of_most_of_their_steps():
    known = KnownActions(torch.tensor([[0, 2, 2, 1, 1, -1]]), ("walk", "wave", "wait"))
    moves = [(1, 0), (0, 0), (0, 0), (0, 0), (0, 0), (0, 0)]
    found = described([0, 1, 1, 2, 2, 3], moves, known=known)
    assert [each.name for each in found] == ["right", "wait", "wave", "stay"]


def test_a_sequence_without_any_movement_is_staying_throughout():
    assert [each.name for each in described([0, 0], [(0, 0), (0, 0)])] == ["stay"]


def test_noise_of_the_synthetic_states_does_not_change_the_names():
    states = make_states(40)
    found = describe_actions(Scripted(states.true_actions, 6), states.dataset.sequences())
    names = [each.name for each in found]
    assert names == ["stay", "left", "right", "forward", "back", "gesture"]


class Walking(ActionModule):
    """Moves by what is written beside each action, whatever it starts from."""

    def __init__(self, moves):
        config = ActionConfig(actions=len(moves), hidden=4, dynamics_width=4, predict_style=True)
        super().__init__(config, 2, 3)
        self.moves = torch.tensor(moves)

    def step(self, state, actions, world_from_camera, memory=None):
        step = super().step(state, actions, world_from_camera, memory)
        return dataclasses.replace(step, movement=self.moves[actions])


def test_a_rollout_names_directions_and_standing_without_any_sequence():
    moves = [(-0.2, 0.0), (0.0, 0.01), (0.15, 0.16), (-0.21, 0.02), (0.0, -0.02)]
    found = describe_by_rollout(Walking(moves))
    assert [each.name for each in found] == ["left", "stay", "forward-right", "left-2", "stay-2"]
    assert [each.movement for each in found] == [pytest.approx(move, abs=1e-6) for move in moves]
    assert {each.share for each in found} == {None}


def test_a_rollout_that_never_moves_is_staying_throughout():
    names = [each.name for each in describe_by_rollout(Walking([(0.0, 0.0)] * 2))]
    assert names == ["stay", "stay-2"]


def test_the_mean_of_a_rollout_is_over_its_steps_and_starts():
    torch.manual_seed(0)
    module = ActionModule(ActionConfig(actions=3, hidden=4, dynamics_width=8), 2, 3)
    starts = neutral_starts(module, (0.0, -11.0, 0.01), reach=0.2)
    described = describe_by_rollout(module, starts, steps=4)
    cameras = torch.tensor([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]).expand(5, 5, 3, 3)
    played = module.play(starts, torch.ones(5, 4, dtype=torch.long), cameras)
    gone = (played.positions[:, -1] - played.positions[:, 0])[:, :2].mean(0) / 4
    assert described[1].movement == pytest.approx(gone.tolist(), abs=1e-6)


def test_neutral_starts_stand_around_their_place():
    module = ActionModule(ActionConfig(position_scale=(10.0, 20.0, 2.0)), 2, 3)
    starts = neutral_starts(module, (0.0, -11.0, 0.01))
    expected = [[0, -11], [1, -9], [-1, -9], [-1, -13], [1, -13]]
    assert torch.allclose(starts.position[:, :2], torch.tensor(expected, dtype=torch.float32))
    assert torch.allclose(starts.position[:, 2], torch.tensor(0.01))
