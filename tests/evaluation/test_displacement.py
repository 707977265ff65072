"""The shift in a pose: known for fields whose bending is known."""

import math
from types import SimpleNamespace

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tiny_model import tiny_config

from pe_runtime.evaluation.displacement import mean_displacement, put_back, turned
from pe_runtime.networks import SynthesisNetworks
from pe_runtime.state import EnvironmentState, ObjectState


@pytest.fixture(scope="module")
def networks():
    torch.manual_seed(0)
    made = SynthesisNetworks(tiny_config()).eval()
    bending = made.fields["player"].bending
    with torch.no_grad():
        # What is left of B is a shift along x by a tenth of the first number of the code.
        for parameter in bending.parameters():
            parameter.zero_()
        bending.pose.weight[0, 0] = 1.0
        bending.layers[0].bias[0] = 3.0  # Keeps the ReLUs open; taken back by the output's bias.
        bending.layers[1].weight[0, 0] = 1.0
        bending.output.weight[0, 0] = 0.1
        bending.output.bias[0] = -0.3
    return made


def pose(amount):
    return torch.tensor([float(amount), 0.0, 0.0])


@given(amount=st.floats(-2.0, 2.0))
def test_a_pose_that_only_shifts_is_measured_exactly(networks, amount):
    shift = mean_displacement(networks.fields["player"], pose(amount))
    # The volume is two metres wide, so half a box size is a metre; its rim is clamped.
    torch.testing.assert_close(shift, torch.tensor([0.1 * amount, 0.0, 0.0]), atol=0.03, rtol=0.0)


def test_a_class_that_does_not_bend_has_no_shift(networks):
    assert mean_displacement(networks.fields["ground"], torch.zeros(0)).tolist() == [0, 0, 0]


def test_putting_back_undoes_the_shift_of_the_body(networks):
    model = SimpleNamespace(config=tiny_config(), networks=networks)
    own, other = (
        EnvironmentState({"player_1": ObjectState(torch.zeros(3), torch.zeros(4), pose(each))})
        for each in (0.0, 2.0)
    )
    # A body whose field reaches 0.2 m further along x appears 0.2 m less far.
    moved = put_back(model, other, own, "player_1")["player_1"].position
    torch.testing.assert_close(moved, torch.tensor([0.2, 0.0, 0.0]), atol=0.03, rtol=0.0)


def test_putting_back_turns_with_the_object():
    torch.testing.assert_close(
        turned(torch.tensor([1.0, 0.0, 2.0]), math.pi / 2), torch.tensor([0.0, 1.0, 2.0])
    )


def test_a_model_without_fields_is_left_alone():
    state = EnvironmentState({"a": ObjectState(torch.ones(3), torch.zeros(1), torch.zeros(1))})
    assert put_back(object(), state, state, "a") is state
