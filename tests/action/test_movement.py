import math

import numpy as np
import pytest
import torch
from synthetic_states import rotations

from pe_runtime.action.movement import ground_axes, moved, movements
from pe_runtime.contract.errors import ConfigError


def camera(yaw=0.0, tilt=0.3, roll=0.0):
    """Looks along +y at yaw 0, tilted down by `tilt`, then rolled about its view direction."""
    rotation = torch.as_tensor(rotations(np.array([yaw]), tilt)[0])
    c, s = math.cos(roll), math.sin(roll)
    return rotation @ torch.tensor([[c, -s, 0], [s, c, 0], [0, 0, 1]], dtype=torch.float64)


def test_a_camera_that_looks_along_y_has_x_to_its_right():
    axes = ground_axes(camera())
    assert torch.allclose(axes, torch.eye(2, dtype=torch.float64))


@pytest.mark.parametrize("tilt", [-0.4, 0.0, 0.3, 1.2, 1.5])
@pytest.mark.parametrize("yaw", [-2.5, -0.3, 0.0, 1.0, 3.0])
def test_axes_turn_with_the_yaw_and_not_with_the_tilt(yaw, tilt):
    axes = ground_axes(camera(yaw, tilt))
    c, s = math.cos(yaw), math.sin(yaw)
    expected = torch.tensor([[c, -s], [s, c]], dtype=torch.float64)
    assert torch.allclose(axes, expected, atol=1e-9)


def test_roll_does_not_change_where_right_is():
    assert torch.allclose(ground_axes(camera(0.4, 0.3, roll=0.8)), ground_axes(camera(0.4, 0.3)))


@pytest.mark.parametrize("tilt", [math.pi / 2, -math.pi / 2])
def test_a_vertical_camera_takes_the_direction_it_had_while_it_tilted(tilt):
    axes = ground_axes(camera(0.7, tilt))
    nearly = ground_axes(camera(0.7, tilt * 0.99))
    assert torch.allclose(axes, nearly, atol=1e-6)


def test_a_matrix_without_any_horizontal_direction_still_gives_numbers():
    broken = torch.zeros(3, 3)
    broken[2] = 1.0
    assert torch.allclose(ground_axes(broken), torch.eye(2))


def test_gradients_of_a_vertical_camera_are_finite():
    rotation = camera(0.2, math.pi / 2).requires_grad_(True)
    ground_axes(rotation).sum().backward()
    assert torch.isfinite(rotation.grad).all()


@pytest.mark.parametrize("batch", [(), (1,), (3, 1, 2)])
def test_axes_arerotations_for_every_batch_shape(batch):
    rotations = torch.linalg.qr(torch.randn(*batch, 3, 3, dtype=torch.float64))[0]
    axes = ground_axes(rotations)
    eye = torch.eye(2, dtype=torch.float64).expand(*batch, 2, 2)
    assert torch.allclose(axes.mT @ axes, eye)
    assert torch.allclose(torch.linalg.det(axes), torch.ones(batch, dtype=torch.float64))


def test_world_frame_ignores_the_camera():
    rotations = torch.stack([camera(1.0), camera(-2.0)])
    eye = torch.eye(2, dtype=torch.float64)
    assert torch.equal(ground_axes(rotations, "world"), eye.expand(2, 2, 2))


def test_the_object_frame_turns_with_the_heading_and_not_with_the_camera():
    headings = torch.tensor([0.0, math.pi / 2], dtype=torch.float64)
    axes = ground_axes(torch.stack([camera(1.0), camera(-2.0)]), "object", headings)
    eye = torch.eye(2, dtype=torch.float64)
    assert torch.allclose(axes[0], eye)
    # Facing along -x, its right is +y.
    assert torch.allclose(axes[1], torch.tensor([[0.0, -1], [1, 0]], dtype=torch.float64))
    assert torch.equal(ground_axes(camera(1.0), "object"), eye)


def test_an_unknown_frame_is_named_in_the_error():
    with pytest.raises(ConfigError, match="'ball'"):
        ground_axes(camera(), "ball")


def test_moving_by_the_measured_movements_gives_the_positions_back():
    generator = torch.Generator().manual_seed(0)
    positions = torch.randn(2, 5, 3, generator=generator, dtype=torch.float64)
    positions[..., 2] = 0.5
    rotations = torch.stack([camera(float(y)) for y in torch.linspace(-2, 2, 10)])
    axes = ground_axes(rotations.reshape(2, 5, 3, 3))
    steps = movements(positions, axes)
    for t in range(4):
        following = moved(positions[:, t], steps[:, t], axes[:, t])
        assert torch.allclose(following, positions[:, t + 1])


def test_walking_right_seen_from_behind_is_walking_left():
    positions = torch.tensor([[0.0, 0, 0], [1, 0, 0]], dtype=torch.float64)
    seen = movements(positions, ground_axes(torch.stack([camera(math.pi), camera()])))
    assert torch.allclose(seen, torch.tensor([[-1.0, 0]], dtype=torch.float64))


def test_one_state_has_no_movement():
    assert movements(torch.zeros(4, 1, 3), torch.zeros(4, 1, 2, 2)).shape == (4, 0, 2)
