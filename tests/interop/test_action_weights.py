import dataclasses
import math

import pytest
import torch
from interop import slow_actions as slow

from pe_runtime.action.discriminator import TemporalDiscriminator
from pe_runtime.action.dynamics import Control
from pe_runtime.action.module import ActionModule
from pe_runtime.action.sampling import Noise, Sampling
from pe_runtime.action.sequences import PlayerState, StateSequence
from pe_runtime.config import ActionConfig
from pe_runtime.contract.errors import ConfigError
from pe_runtime.geometry.native_world import WORLD_FROM_NATIVE
from pe_runtime.interop.action_weights import (
    NATIVE_ACTIONS,
    action_entries,
    convert_action_module,
    convert_discriminator,
    discriminator_entries,
)

STYLE, POSE = 4, 3
TENNIS = ActionConfig(
    design="state",
    actions=5,
    variability=2,
    hidden=6,
    dynamics_width=5,
    dynamics_layers=2,
    discriminator="states",
    discriminator_width=4,
    position_scale=(10.0, 20.0, 2.15),
    bounded_positions=False,
    movement_scale=1.0,
    movement_frame="object",
    sees_heading=True,
    predict_style=True,
)
MINECRAFT = dataclasses.replace(
    TENNIS,
    position_scale=(10.0, 10.0, 2.15),
    discriminator_scale=(10.0, 10.0, 2.15),
    predict_heading=True,
)
WORLDS = [("tennis", TENNIS), ("minecraft", MINECRAFT)]
JUDGED_BOXES = {"tennis": (1.0, 1.0, 1.0), "minecraft": (10.0, 2.15, 10.0)}


def made_up(entries, seed=0):
    generator = torch.Generator().manual_seed(seed)
    made = {
        name: torch.randn(shape, generator=generator, dtype=torch.float64)
        for name, shape in entries.items()
    }
    return {n: t.abs() + 0.5 if n.endswith("running_std") else t for n, t in made.items()}


def imported(theirs, config, world, double=True):
    module = ActionModule(config, STYLE, POSE).eval()
    module.load_state_dict(convert_action_module(theirs, config, NATIVE_ACTIONS[world]))
    return module.double() if double else module


def states(world, steps, seed=1):
    """Angles, places and codes of one object in their axes, and the same as a sequence of ours."""
    generator = torch.Generator().manual_seed(seed)
    native = NATIVE_ACTIONS[world]
    angles = torch.zeros(steps, 3, dtype=torch.float64)
    angles[:, native.axis] = torch.randn(steps, generator=generator, dtype=torch.float64)
    sizes = (3, STYLE, POSE)
    drawn = [torch.randn(steps, n, generator=generator, dtype=torch.float64) for n in sizes]
    places = drawn[0] * torch.tensor([4.0, 6.0, 5.0], dtype=torch.float64)
    positions = places @ WORLD_FROM_NATIVE[native.up].T
    cameras = torch.eye(3, dtype=torch.float64).expand(1, steps, 3, 3)
    ours = (positions[None], drawn[1][None], drawn[2][None], cameras, angles[None, :, native.axis])
    return (angles, places, *drawn[1:]), StateSequence(*ours)


class Given(Noise):
    """Hands out one tensor of normal numbers, and 1 for all others."""

    def __init__(self, normal):
        self.given = normal

    def uniform(self, *shape):
        return torch.full(shape, 0.5)

    def normal(self, like):
        assert like.shape == self.given.shape
        return self.given

    def exponential(self, like):
        return torch.ones_like(like)


@pytest.mark.parametrize(("world", "config"), WORLDS)
def test_converted_tensors_are_exactly_those_of_our_modules(world, config):
    module, judge = ActionModule(config, STYLE, POSE), TemporalDiscriminator(config, POSE)
    theirs = made_up(action_entries(config, STYLE, POSE))
    found = convert_action_module(theirs, config, NATIVE_ACTIONS[world])
    assert {n: t.shape for n, t in found.items()} == shapes(module)
    theirs = made_up(discriminator_entries(config, POSE))
    found = convert_discriminator(theirs, NATIVE_ACTIONS[world])
    assert {n: t.shape for n, t in found.items()} == shapes(judge)


def shapes(module):
    return {name: tensor.shape for name, tensor in module.state_dict().items()}


@pytest.mark.parametrize(("world", "config"), WORLDS)
def test_an_imported_a_agrees_with_its_slow_twin(world, config):
    theirs = made_up(action_entries(config, STYLE, POSE))
    (angles, places, *_), sequence = states(world, 4)
    noise = torch.randn(1, 3, 2, generator=torch.Generator().manual_seed(5), dtype=torch.float64)
    network = imported(theirs, config, world).action_network
    estimate = network(sequence, Given(noise))
    actions = torch.softmax(estimate.logits, dim=-1)
    v = network.variability(estimate, actions, Sampling(1.0, 0.0, 1.0, Given(noise)))
    box = NATIVE_ACTIONS[world].seen_scale
    points = [
        slow.embedded(theirs, a, p, box)
        for a, p in zip(angles.tolist(), places.tolist(), strict=True)
    ]
    for t in range(3):
        drawn, logits = slow.direction(theirs, points[t], points[t + 1], noise[0, t].tolist())
        assert estimate.direction[0, t].tolist() == pytest.approx(drawn, rel=1e-5, abs=1e-5)
        assert estimate.logits[0, t].tolist() == pytest.approx(logits, rel=1e-5, abs=1e-5)
        expected = slow.variability(theirs, actions[0, t].tolist(), drawn)
        assert v[0, t].tolist() == pytest.approx(expected, rel=1e-5, abs=1e-5)


@pytest.mark.parametrize(("world", "config"), WORLDS)
@pytest.mark.parametrize("scale", [None, (3.0, 4.0, 5.0)])
def test_an_imported_r_agrees_with_its_slow_twin(world, config, scale):
    config = config if scale is None else dataclasses.replace(config, position_scale=scale)
    theirs = made_up(action_entries(config, STYLE, POSE))
    (angles, places, style, pose), sequence = states(world, 1)
    now, memory = sequence.at(0), None
    native = NATIVE_ACTIONS[world]
    dynamics = imported(theirs, config, world).dynamics
    state = tuple(each[0].tolist() for each in (angles, places, style, pose))
    twin = slow.first_memory(theirs)
    generator = torch.Generator().manual_seed(9)
    for _ in range(3):
        action = torch.rand(1, 5, generator=generator, dtype=torch.float64)
        v = torch.randn(1, 2, generator=generator, dtype=torch.float64)
        control = Control(action, v, sequence.world_from_camera[:, 0])
        step = dynamics(now, control, memory or dynamics.initial_memory(1))
        now, memory = step.state, step.memory
        facts = (native.axis, native.rolled_scale, config.predict_heading)
        given = (action[0].tolist(), v[0].tolist())
        state, twin = slow.step(theirs, state, given, twin, facts)
        place = now.position[0] @ WORLD_FROM_NATIVE[native.up]
        assert place.tolist() == pytest.approx(state[1], abs=1e-5)
        turned = math.remainder(now.heading.item() - state[0][native.axis], math.tau)
        assert turned == pytest.approx(0.0, abs=1e-5)
        assert now.style[0].tolist() == pytest.approx(state[2], abs=1e-5)
        assert now.pose[0].tolist() == pytest.approx(state[3], abs=1e-5)
        assert memory.hidden[:, 0].tolist() == [pytest.approx(h, abs=1e-5) for h, _ in twin]
        assert memory.cell[:, 0].tolist() == [pytest.approx(c, abs=1e-5) for _, c in twin]


@pytest.mark.parametrize(("world", "config"), WORLDS)
def test_an_imported_d_agrees_with_its_slow_twin(world, config):
    theirs = made_up(discriminator_entries(config, POSE))
    judge = TemporalDiscriminator(config, POSE).eval()
    judge.load_state_dict(convert_discriminator(theirs, NATIVE_ACTIONS[world]))
    (_, places, _, pose), sequence = states(world, 6)
    valid = torch.tensor([[True] * 4 + [False] * 2])
    actions = torch.softmax(torch.randn(1, 5, 5, dtype=torch.float64), dim=-1)
    directions = torch.randn(1, 5, 2, dtype=torch.float64)
    found = judge.double()(sequence, actions, directions, valid)
    taken = torch.cat([actions, directions], dim=-1)[0].tolist()
    rows = []
    for t in range(6):
        place = [x / size for x, size in zip(places[t].tolist(), JUDGED_BOXES[world], strict=True)]
        row = [*place, *pose[t].tolist(), *taken[min(t, 4)]]
        rows.append([x * float(valid[0, t]) for x in row])
    expected = slow.judged(theirs, rows, valid[0].tolist())
    assert found.item() == pytest.approx(expected, rel=1e-5, abs=1e-5)


def test_their_up_axis_is_our_z_in_a_rolled_out_minecraft():
    theirs = made_up(action_entries(MINECRAFT, STYLE, POSE))
    theirs["dynamics_network.mlp_heads.1.weight"].zero_()
    theirs["dynamics_network.mlp_heads.1.bias"].copy_(torch.tensor([1.0, 50.0, -2.0]))
    module = imported(theirs, MINECRAFT, "minecraft", double=False)
    start = PlayerState(
        torch.tensor([[3.0, 4.0, 0.7]]), torch.zeros(1, STYLE), torch.zeros(1, POSE), torch.zeros(1)
    )
    step = module.step(start, torch.zeros(1, dtype=torch.long), torch.eye(3)[None])
    # Their (1, 50, -2) is 1 to the right, 50 up and 2 away; objects stay at their height.
    assert step.state.position[0].tolist() == pytest.approx([4.0, 6.0, 0.7])
    faced = dataclasses.replace(start, heading=torch.tensor([math.pi / 2]))
    step = module.step(faced, torch.zeros(1, dtype=torch.long), torch.eye(3)[None])
    assert step.state.position[0].tolist() == pytest.approx([1.0, 5.0, 0.7], abs=1e-6)


def test_an_imported_discriminator_trains_on_with_its_spectral_norm():
    theirs = made_up(discriminator_entries(TENNIS, POSE))
    judge = TemporalDiscriminator(TENNIS, POSE)
    judge.load_state_dict(convert_discriminator(theirs, NATIVE_ACTIONS["tennis"]))
    for _ in range(60):
        judge.judge(torch.randn(2, 6, 13))
    for layer in judge.layers:
        norm = torch.linalg.matrix_norm(layer.weight.flatten(1), 2).item()
        assert norm == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(
    "change", [{"bounded_positions": True}, {"predict_style": False}, {"movement_frame": "camera"}]
)
def test_a_module_of_another_design_takes_none_of_their_weights(change):
    theirs = made_up(action_entries(TENNIS, STYLE, POSE))
    with pytest.raises(ConfigError, match="of the paper's authors"):
        config = dataclasses.replace(TENNIS, **change)
        convert_action_module(theirs, config, NATIVE_ACTIONS["tennis"])
