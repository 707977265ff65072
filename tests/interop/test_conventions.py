"""Cameras and places of the authors' release in our terms, worked out by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pe_runtime.contract.camera import project
from pe_runtime.contract.errors import CameraError
from pe_runtime.interop.conventions import (
    camera_from_theirs,
    focal_from_theirs,
    positions_from_theirs,
)

SIZE = (512, 288)


def camera(angles=(0.0, 0.0, 0.0), place=(0.0, 0.0, 0.0), focal=500.0, up="z"):
    return camera_from_theirs(np.array(angles), np.array(place), focal, SIZE, up)


def test_an_unturned_camera_looks_down_its_z_axis_with_y_up():
    pixels, depth = project(camera(), np.array([[0.0, 0.0, -10.0], [1.0, 2.0, -10.0]]))
    assert depth.tolist() == [10.0, 10.0]
    assert pixels[0].tolist() == [256.0, 144.0]
    assert pixels[1].tolist() == [256.0 + 50.0, 144.0 - 100.0]


def test_a_tennis_camera_tilted_by_a_right_angle_looks_along_the_court():
    looking = camera((np.pi / 2, 0.0, 0.0), (0.0, -30.0, 8.0))
    pixels, depth = project(looking, np.array([[0.0, 10.0, 8.0], [4.0, 10.0, 10.0]]))
    assert depth == pytest.approx([40.0, 40.0], rel=1e-6)
    assert pixels[1] == pytest.approx([256 + 50.0, 144 - 25.0], abs=1e-3)


def test_in_minecraft_their_height_is_our_height_and_their_depth_our_negative_y():
    assert positions_from_theirs(np.array([1.0, 2.0, 3.0]), "y").tolist() == [1.0, -3.0, 2.0]
    assert positions_from_theirs(np.array([[1.0, 2.0, 3.0]]), "z").tolist() == [[1.0, 2.0, 3.0]]
    looking = camera(place=(0.0, 1.6, 5.0), up="y")
    point = positions_from_theirs(np.array([[0.5, 2.6, -5.0]]), "y")
    pixels, depth = project(looking, point)
    assert depth.tolist() == pytest.approx([10.0])
    assert pixels[0] == pytest.approx([256 + 25.0, 144 - 50.0])


@given(st.tuples(*[st.floats(-1.4, 1.4)] * 3), st.tuples(*[st.floats(-3, 3)] * 3))
def test_both_worlds_see_the_same_picture_of_the_same_things(angles, point):
    theirs = np.array([*point])
    z = project(camera(angles, (1.0, 2.0, 3.0)), positions_from_theirs(theirs[None], "z"))
    y = project(camera(angles, (1.0, 2.0, 3.0), up="y"), positions_from_theirs(theirs[None], "y"))
    assert z[1] == pytest.approx(y[1], abs=1e-5)
    if z[1][0] > 0.1:
        assert z[0] == pytest.approx(y[0], abs=0.05, rel=1e-4)


def test_focal_lengths_become_pixels_of_their_pictures():
    assert focal_from_theirs(2000.0, 0.5) == 1000.0
    assert focal_from_theirs(2280.0, 0.51417) == pytest.approx(1172.3, abs=0.1)


@pytest.mark.parametrize("focal", [0.0, -3.0, float("nan")])
def test_a_camera_without_a_focal_length_is_refused(focal):
    with pytest.raises(CameraError):
        camera(focal=focal)
