"""Cameras found from points on the ground: the true ones come back, the impossible ones do not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pe_runtime.contract.camera import Camera, project
from pe_runtime.contract.errors import CameraError
from pe_runtime.footage.ground_points import match_camera

SIZE = (640, 360)
COURT = np.array([[-2.0, -1.0], [2.0, -1.0], [2.2, 2.0], [-1.8, 2.3], [0.3, 0.2], [1.0, 1.1]])


def look_at(eye, target, focal, roll=0.0, size=SIZE):
    forward = np.subtract(target, eye) / np.linalg.norm(np.subtract(target, eye))
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    turned = np.array(
        [[np.cos(roll), -np.sin(roll), 0], [np.sin(roll), np.cos(roll), 0], [0, 0, 1]]
    )
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1) @ turned
    pose[:3, 3] = eye
    middle = size[0] / 2, size[1] / 2
    return Camera(*size, np.array([[focal, 0, middle[0]], [0, focal, middle[1]], [0, 0, 1]]), pose)


def seen(camera, ground=COURT):
    pixels, _ = project(camera, np.pad(ground, ((0, 0), (0, 1))))
    return np.hstack([pixels, ground])


CAMERAS = st.builds(
    look_at,
    st.tuples(st.floats(-6, 6), st.floats(-18, -5), st.floats(0.8, 8)),
    st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.just(0.0)),
    st.floats(350, 1800),
    st.floats(-0.2, 0.2),
)


@settings(max_examples=60, deadline=None)
@given(CAMERAS, st.integers(4, 6), st.booleans())
def test_a_camera_comes_back_from_the_points_that_it_sees(camera, count, knows_focal):
    focal = camera.intrinsics[0, 0] if knows_focal else None
    found = match_camera(SIZE, seen(camera, COURT[:count]).tolist(), focal)
    assert found.residual <= found.worst < 0.01
    np.testing.assert_allclose(
        found.camera.world_from_camera, camera.world_from_camera, rtol=0, atol=0.01
    )
    assert found.camera.intrinsics[0, 0] == pytest.approx(camera.intrinsics[0, 0], rel=1e-3)
    assert (found.camera.width, found.camera.height) == SIZE


def test_the_residual_grows_with_the_noise_and_the_worst_point_is_told():
    points = seen(look_at((1.0, -9.0, 3.0), (0, 0, 0), 600.0))
    noise = np.random.default_rng(1).normal(size=(len(points), 2))
    residuals = []
    for scale in (0.0, 0.5, 2.0):
        noisy = points.copy()
        noisy[:, :2] += scale * noise
        found = match_camera(SIZE, noisy)
        assert found.worst >= found.residual
        residuals.append(found.residual)
    assert residuals[0] < 1e-3 < residuals[1] < residuals[2] < 2 * 3


def test_a_focal_length_that_is_given_is_kept():
    points = seen(look_at((1.0, -9.0, 3.0), (0, 0, 0), 600.0))
    found = match_camera(SIZE, points, 700.0)
    assert found.camera.intrinsics[0, 0] == found.camera.intrinsics[1, 1] == 700.0
    assert found.residual > 0.05


FOUR = seen(look_at((1.0, -9.0, 3.0), (0, 0, 0), 600.0))[:4].tolist()
LINE = [[10.0 * i, 20.0 * i, 1.0 * i, 2.0 * i] for i in range(5)]


@pytest.mark.parametrize(
    ("points", "named"),
    [
        ([], "found 0; add 4"),
        (FOUR[:3], "found 3; add 1"),
        (LINE, "on one line in the picture"),
        ([[10.0, 1.0, 0, 0], [50, 2, 1, 1], [11, 90, 2, 2], [60, 80, 3, 3]], "line on the ground"),
        ([*LINE[:4], [1.0, 50.0, 9.0, 1.0]], "all but one"),
        ([FOUR[0], FOUR[0], *FOUR[1:3]], "on one line"),
        ([*FOUR[:3], [1.0, 2.0, float("nan"), 3.0]], "NaN"),
        ([*FOUR[:3], [1.0, 2.0]], "numbers|rows"),
        ([[1.0, 2.0, 3.0]] * 4, "rows of u, v, x and y"),
        ([*FOUR[:3], ["a", "b", "c", "d"]], "not numbers"),
    ],
)
def test_points_that_tell_no_camera_are_refused_with_what_to_do(points, named):
    with pytest.raises(CameraError, match=named):
        match_camera(SIZE, points)


def test_points_that_are_swapped_are_refused_whether_or_not_the_focal_length_is_known():
    mirrored = [[u, v, -x, y] for u, v, x, y in FOUR]
    for focal in (None, 600.0):
        with pytest.raises(CameraError, match="mirrored"):
            match_camera(SIZE, mirrored, focal)


def test_a_place_that_is_wrong_by_metres_is_named():
    points = seen(look_at((1.0, -9.0, 3.0), (0, 0, 0), 600.0))
    points[4, 2:] += [1.5, 1.0]
    with pytest.raises(CameraError, match="no camera fits.*point 5"):
        match_camera(SIZE, points, 600.0)


def test_a_focal_length_that_nothing_tells_is_asked_for():
    down = look_at((0.0, 0.0001, 6.0), (0, 0.0002, 0), 600.0)
    with pytest.raises(CameraError, match="do not tell the focal length"):
        match_camera(SIZE, seen(down))
    assert match_camera(SIZE, seen(down), 600.0).worst < 0.01


@pytest.mark.parametrize("focal", [0.0, -1.0, float("nan"), float("inf")])
def test_a_focal_length_is_above_0(focal):
    with pytest.raises(CameraError, match="focal length"):
        match_camera(SIZE, FOUR, focal)


def test_a_picture_has_pixels():
    with pytest.raises(CameraError, match="0x360"):
        match_camera((0, 360), FOUR)
