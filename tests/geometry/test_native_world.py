"""Worlds with another up axis, and Euler angles in them."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pe_runtime.geometry.native_world import (
    WORLD_FROM_NATIVE,
    euler_from_rotation,
    rotation_from_euler,
)

ANGLES = st.tuples(*[st.floats(-math.pi, math.pi)] * 3)


def rotation(*angles):
    return rotation_from_euler(torch.tensor(angles, dtype=torch.float64))


@given(ANGLES)
def test_angles_give_a_rotation_and_the_rotation_gives_it_back(angles):
    matrix = rotation(*angles)
    assert torch.allclose(matrix @ matrix.T, torch.eye(3).double(), atol=1e-12)
    assert torch.linalg.det(matrix).item() == pytest.approx(1.0)
    again = rotation_from_euler(euler_from_rotation(matrix))
    assert torch.allclose(again, matrix, atol=1e-7)


@given(st.tuples(st.floats(-1.5, 1.5), *[st.floats(-3.1, 3.1)] * 2))
def test_below_a_right_angle_the_angles_themselves_come_back(angles):
    found = euler_from_rotation(rotation(*angles))
    assert found.tolist() == pytest.approx(list(angles), abs=1e-9)


@pytest.mark.parametrize("a", [math.pi / 2, -math.pi / 2])
def test_looking_straight_along_the_lock_still_gives_the_same_rotation(a):
    matrix = rotation(a, 0.7, -0.4)
    found = euler_from_rotation(matrix)
    assert found[2] == 0
    assert torch.allclose(rotation_from_euler(found), matrix, atol=1e-7)


def test_about_z_first_then_x_then_y():
    quarter = math.pi / 2
    x_axis = torch.tensor([1.0, 0.0, 0.0], dtype=torch.float64)
    # z turns x to y, x turns y to z, y turns z to x.
    turned = rotation(quarter, quarter, quarter) @ x_axis
    assert turned.tolist() == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)
    assert (rotation(0.0, 0.0, quarter) @ x_axis).tolist() == pytest.approx([0, 1, 0], abs=1e-12)


def test_batches_of_any_shape_are_turned_alike():
    angles = torch.tensor([[[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]], dtype=torch.float64)
    assert rotation_from_euler(angles).shape == (1, 2, 3, 3)
    assert torch.allclose(euler_from_rotation(rotation_from_euler(angles)), angles)


def test_what_is_up_natively_is_up_in_our_world():
    up = torch.tensor([0.0, 1.0, 0.0], dtype=torch.float64)
    assert (WORLD_FROM_NATIVE["y"] @ up).tolist() == [0.0, 0.0, 1.0]
    for turn in WORLD_FROM_NATIVE.values():
        assert torch.linalg.det(turn).item() == 1.0


def test_a_turn_about_native_up_is_the_same_turn_about_ours():
    turn = WORLD_FROM_NATIVE["y"]
    ours = turn @ rotation(0.0, 0.8, 0.0) @ turn.T
    assert torch.allclose(ours, rotation(0.0, 0.0, 0.8))
