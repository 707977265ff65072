import dataclasses
import math

import pytest
import torch
from synthetic_states import make_states

from pe_runtime.action.dynamics import Control, DynamicsNetwork
from pe_runtime.action.sequences import PlayerState
from pe_runtime.config import ActionConfig

SMALL = ActionConfig(actions=5, variability=3, dynamics_width=24, dynamics_layers=2)


@pytest.fixture
def network():
    torch.manual_seed(0)
    return DynamicsNetwork(SMALL, 8, 16)


def control(batch, action=1):
    one_hot = torch.nn.functional.one_hot(torch.full((batch,), action), 5).float()
    cameras = make_states(4, steps=2).dataset.world_from_camera[:batch, 0]
    return Control(one_hot, torch.zeros(batch, 3), cameras)


def state(batch, seed=0):
    generator = torch.Generator().manual_seed(seed)
    sizes = (3, 8, 16)
    position, style, pose = (torch.randn(batch, n, generator=generator) for n in sizes)
    return PlayerState(position, style, pose)


def roll(network, start, actions, memory=None):
    memory = memory or network.initial_memory(start.position.shape[0])
    states = [start]
    for action in actions:
        step = network(states[-1], control(start.position.shape[0], action), memory)
        states.append(step.state)
        memory = step.memory
    return states, memory


@pytest.mark.parametrize("batch", [1, 3])
def test_a_step_keeps_shapes_style_and_height(network, batch):
    before = state(batch)
    step = network(before, control(batch), network.initial_memory(batch))
    assert step.state.pose.shape == before.pose.shape
    assert step.movement.shape == (batch, 2)
    assert torch.equal(step.state.style, before.style)
    assert torch.equal(step.state.position[:, 2], before.position[:, 2])


def test_memory_from_a_branch_leaves_the_trunk_as_it_was(network):
    trunk, memory = roll(network, state(2), [0, 1, 2])
    kept = memory.hidden.clone(), memory.cell.clone()
    first, _ = roll(network, trunk[-1], [3, 3], memory)
    roll(network, trunk[-1], [4, 0, 4], memory)
    again, _ = roll(network, trunk[-1], [3, 3], memory)
    assert torch.equal(first[-1].position, again[-1].position)
    assert torch.equal(memory.hidden, kept[0]) and torch.equal(memory.cell, kept[1])


def test_a_rollout_in_pieces_equals_one_in_whole(network):
    whole, _ = roll(network, state(2), [0, 1, 2, 3])
    half, memory = roll(network, state(2), [0, 1])
    rest, _ = roll(network, half[-1], [2, 3], memory)
    assert torch.equal(whole[-1].position, rest[-1].position)
    assert torch.equal(whole[-1].pose, rest[-1].pose)


def test_objects_of_a_batch_do_not_see_each_other(network):
    both, _ = roll(network, state(2), [0, 1])
    start = state(2)
    alone = PlayerState(start.position[:1], start.style[:1], start.pose[:1])
    single, _ = roll(network, alone, [0, 1])
    assert torch.allclose(both[-1].pose[:1], single[-1].pose, atol=1e-6)


@pytest.mark.parametrize("predict_style", [False, True])
def test_every_parameter_gets_a_gradient(predict_style):
    torch.manual_seed(0)
    config = ActionConfig(actions=5, variability=3, dynamics_width=24, predict_style=predict_style)
    network = DynamicsNetwork(config, 8, 16)
    states, _ = roll(network, state(3), [0, 1, 2, 3, 4])
    sum(s.position.square().sum() + s.pose.sum() + s.style.sum() for s in states).backward()
    without = [n for n, p in network.named_parameters() if p.grad is None or not p.grad.any()]
    assert not without


def test_restyling_changes_neither_path_nor_pose(network):
    start = state(2)
    restyled = PlayerState(start.position, start.style + 1.0, start.pose)
    first, _ = roll(network, start, [0, 1, 2])
    other, _ = roll(network, restyled, [0, 1, 2])
    assert torch.equal(first[-1].position, other[-1].position)
    assert torch.equal(first[-1].pose, other[-1].pose)


def test_ten_thousand_steps_stay_finite_and_poses_stay_small(network):
    with torch.no_grad():
        given, memory, now = control(1), network.initial_memory(1), state(1)
        for _ in range(10_000):
            step = network(now, given, memory)
            now, memory = step.state, step.memory
    assert torch.isfinite(now.position).all() and torch.isfinite(memory.cell).all()
    assert now.pose.abs().max() < 100
    assert step.movement.abs().max() < 100 * SMALL.movement_scale


def test_turning_the_camera_turns_the_movement(network):
    turn = torch.tensor([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    given, start = control(1), state(1)
    turned = Control(given.action, given.variability, turn @ given.world_from_camera)
    memory = network.initial_memory(1)
    step, other = network(start, given, memory), network(start, turned, memory)
    moved = (step.state.position - start.position) @ turn.T
    assert torch.allclose(other.state.position - start.position, moved, atol=1e-5)


def facing(start, heading):
    return dataclasses.replace(start, heading=torch.full((len(start.position),), heading))


def turning(**further):
    torch.manual_seed(0)
    knobs = {"sees_heading": True, "movement_frame": "object"} | further
    return DynamicsNetwork(dataclasses.replace(SMALL, **knobs), 8, 16)


def test_a_heading_is_handed_on_unless_it_is_predicted(network):
    assert roll(network, state(2), [0, 1])[0][-1].heading is None
    kept = roll(turning(), facing(state(2), 0.7), [0, 1])[0][-1].heading
    assert torch.equal(kept, torch.full((2,), 0.7))
    turned = roll(turning(predict_heading=True), state(2), [0, 1])[0][-1].heading
    assert (turned.abs() > 1e-3).all()


def test_a_predicted_turn_is_the_angle_of_its_sine_and_cosine():
    network = turning(predict_heading=True)
    with torch.no_grad():
        network.turn.weight.zero_()
        network.turn.bias.copy_(torch.tensor([1.0, -1.0]))
    step = network(facing(state(1), 0.5), control(1), network.initial_memory(1))
    assert torch.allclose(step.state.heading, torch.tensor([0.5 + 0.75 * math.pi]))


def test_in_the_object_frame_a_turned_object_goes_another_way_under_any_camera():
    network = turning(sees_heading=False)
    start, memory = state(1), network.initial_memory(1)
    ahead = network(facing(start, 0.0), control(1), memory)
    turned = network(facing(start, math.pi / 2), control(1), memory)
    assert torch.equal(ahead.movement, turned.movement)
    right, forward = ahead.movement[0].tolist()
    moved = (ahead.state.position - start.position)[0, :2].tolist()
    assert moved == pytest.approx([right, forward], abs=1e-6)
    moved = (turned.state.position - start.position)[0, :2].tolist()
    assert moved == pytest.approx([-forward, right], abs=1e-6)


def test_a_seen_heading_counts_only_up_to_whole_turns():
    network = turning(movement_frame="world")
    start, memory = state(1), network.initial_memory(1)
    poses = [
        network(facing(start, a), control(1), memory).state.pose for a in (0.4, 0.4 + math.tau)
    ]
    other = network(facing(start, 1.4), control(1), memory).state.pose
    assert torch.allclose(*poses, atol=1e-5)
    assert not torch.allclose(poses[0], other, atol=1e-4)


@pytest.mark.parametrize(("bounded", "differ"), [(True, False), (False, True)])
def test_far_away_is_one_place_only_where_positions_are_bounded(bounded, differ):
    network = turning(bounded_positions=bounded)
    start, memory = state(1), network.initial_memory(1)
    places = [torch.tensor([[40.0, -40.0, 20.0]]) * times for times in (1, 2)]
    far, farther = (dataclasses.replace(start, position=place) for place in places)
    first, second = (network(each, control(1), memory).state.pose for each in (far, farther))
    assert torch.allclose(first, second, atol=1e-5) is not differ


def test_every_parameter_of_a_turning_r_gets_a_gradient():
    network = turning(predict_heading=True)
    states, _ = roll(network, facing(state(3), 0.2), [0, 1, 2, 3, 4])
    sum(s.position.square().sum() + s.pose.sum() + s.heading.sum() for s in states).backward()
    without = [n for n, p in network.named_parameters() if p.grad is None or not p.grad.any()]
    assert not without


def test_two_thousand_turns_end_where_exact_angles_do():
    config = dataclasses.replace(
        SMALL, sees_heading=True, predict_heading=True, movement_frame="object"
    )
    torch.manual_seed(0)
    network = DynamicsNetwork(config, 8, 16)
    with torch.no_grad():
        network.turn.weight.zero_()
        network.turn.bias.copy_(torch.tensor([math.sin(2.5), math.cos(2.5)]))
        now, memory = state(1), network.initial_memory(1)
        for _ in range(2_000):
            step = network(now, control(1), memory)
            now, memory = step.state, step.memory
            assert now.heading.abs().item() <= math.pi + 1e-6
    sine, cosine = network.turn.bias.double().tolist()
    exact = 2_000 * math.atan2(sine, cosine)
    assert abs(math.remainder(now.heading.item() - exact, math.tau)) < 5e-4
