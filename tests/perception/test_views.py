import math

import numpy as np
import pytest
import torch
from small_world import HEIGHT, WIDTH, camera

from pe_runtime.config import EncoderConfig
from pe_runtime.geometry.cameras import Cameras
from pe_runtime.interop.conventions import camera_from_theirs
from pe_runtime.perception.views import camera_angles, camera_features, view_features, view_size

ANGLES = [(1.3743, 0.021, -0.013), (-0.4224, 0.8593, 0.0267), (0.1, -3.0, 0.4)]
PLACE = (0.35, -38.9, 8.55)


def native(angles, up, place=PLACE):
    """Our camera of one described in the native world's axes, OpenGL's camera axes."""
    return Cameras.stack([camera_from_theirs(np.array(angles), np.array(place), 99.0, (8, 6), up)])


@pytest.mark.parametrize("up", ["z", "y"])
@pytest.mark.parametrize("angles", ANGLES)
def test_a_camera_s_native_angles_and_place_are_told_again(angles, up):
    told = camera_features(native(angles, up), up)
    np.testing.assert_allclose(told[0].numpy(), [*angles, *PLACE], atol=1e-6, rtol=1e-7)


def test_angles_are_told_within_a_turn_around_the_middle_asked_for():
    cameras = native((-0.2, 0.3, 0.0), "y")
    told = camera_features(cameras, "y", (math.tau, math.tau, 0.0))[0, :3]
    assert told.tolist() == pytest.approx([math.tau - 0.2, math.tau + 0.3, 0.0], abs=1e-6)
    told = camera_features(cameras, "y", (0.0, -7.0, 0.0))[0, :3]
    assert told.tolist() == pytest.approx([-0.2, 0.3 - math.tau, 0.0], abs=1e-6)


def test_the_native_up_axis_changes_what_is_told():
    cameras = native(ANGLES[1], "y")
    assert not torch.allclose(camera_angles(cameras, "y"), camera_angles(cameras, "z"))


def test_a_level_camera_that_looks_along_the_native_minus_z_has_no_angles():
    # Ours: x right, forward is the world's +y, which is the native -z.
    turn = torch.tensor([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    cameras = Cameras(8, 6, torch.eye(3).double()[None], turn.double()[None])
    torch.testing.assert_close(camera_angles(cameras, "y"), torch.zeros(1, 3).double())


@pytest.mark.parametrize(("view", "numbers"), [("direction", 6), ("camera", 6), ("none", 0)])
def test_the_configuration_says_how_many_numbers_a_view_has(view, numbers):
    assert view_size(EncoderConfig(view=view)) == numbers


def test_no_cameras_tell_nothing():
    cameras = Cameras(8, 6, torch.zeros(0, 3, 3).double(), torch.zeros(0, 4, 4).double())
    assert camera_features(cameras, "y").shape == (0, 6)


def test_view_features_say_direction_and_size():
    view = camera(azimuth=0.5)
    places = torch.tensor([[0.3, 0.1, 0.0]])
    region = torch.tensor([[8.0, 4.0, 16.0, 12.0]])
    features = view_features(Cameras.stack([view]), places, region)[0]
    away = places[0] - torch.from_numpy(view.world_from_camera[:3, 3].copy()).float()
    torch.testing.assert_close(features[:3], away / away.norm(), atol=1e-6, rtol=0)
    assert features[3:].tolist() == pytest.approx([8 / WIDTH, 8 / HEIGHT, 12 / WIDTH - 0.5])
