"""The pinhole camera: validation, JSON, projection, and Blender's lens arithmetic."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pe_runtime.contract.camera import BlenderLens, Camera, camera_from_blender, project
from pe_runtime.contract.errors import CameraError

LENS = BlenderLens(
    type="PERSP",
    lens=50.0,
    sensor_width=36.0,
    sensor_height=24.0,
    sensor_fit="AUTO",
    shift_x=0.0,
    shift_y=0.0,
    resolution_x=1920,
    resolution_y=1080,
    resolution_percentage=100,
    pixel_aspect_x=1.0,
    pixel_aspect_y=1.0,
)


def rotation(angles):
    """A rotation about x, then y, then z (radians)."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles), np.sin(angles)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def pose(angles=(0.0, 0.0, 0.0), at=(0.0, 0.0, 0.0)):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation(np.array(angles)), at
    return matrix


def pinhole(width=64, height=48, focal=50.0, **where):
    intrinsics = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
    return Camera(width, height, intrinsics, pose(**where))


angle = st.floats(-3.1, 3.1)
coordinate = st.floats(-50, 50)
triple = st.tuples(coordinate, coordinate, coordinate)
cameras = st.builds(
    pinhole,
    width=st.integers(1, 4000),
    height=st.integers(1, 4000),
    focal=st.floats(1, 5000),
    angles=st.tuples(angle, angle, angle),
    at=triple,
)


@given(cameras)
def test_a_camera_comes_back_from_json_with_the_same_bits(camera):
    again = Camera.from_dict(json.loads(json.dumps(camera.as_dict())))
    assert again == camera
    assert hash(again) == hash(camera)


def test_cameras_that_differ_in_one_number_are_unequal():
    camera = pinhole()
    assert camera != pinhole(focal=50.000001)
    assert camera != pinhole(at=(0, 0, 1e-9))
    assert camera != pinhole(width=65)
    assert camera != "camera"


def test_positive_and_negative_zero_make_the_same_camera():
    assert pinhole(at=(0.0, 0.0, 0.0)) == pinhole(at=(-0.0, 0.0, 0.0))
    assert hash(pinhole(at=(0.0, 0.0, 0.0))) == hash(pinhole(at=(-0.0, 0.0, 0.0)))


def test_nobody_can_change_a_camera_through_its_arrays():
    intrinsics = np.diag([50.0, 50.0, 1.0])
    camera = Camera(64, 48, intrinsics, np.eye(4))
    intrinsics[0, 0] = 1.0
    assert camera.intrinsics[0, 0] == 50.0
    with pytest.raises(ValueError, match="read-only"):
        camera.world_from_camera[0, 3] = 1.0


@pytest.mark.parametrize(
    ("key", "value", "complaint"),
    [
        ("width", 0, "width"),
        ("width", 12.5, "width"),
        ("height", True, "height"),
        ("height", "48", "height"),
        ("intrinsics", [[1, 0, 0], [0, 1, 0]], "shape"),
        ("intrinsics", [[1, 0, 0], [0, 1], [0, 0, 1]], "intrinsics is not a matrix"),
        ("intrinsics", "wide", "intrinsics"),
        ("intrinsics", [["1", 0, 0], [0, 1, 0], [0, 0, 1]], "intrinsics"),
        ("intrinsics", [[float("nan"), 0, 0], [0, 1, 0], [0, 0, 1]], "NaN"),
        ("intrinsics", [[0, 0, 0], [0, 1, 0], [0, 0, 1]], "above 0"),
        ("intrinsics", [[1, 0.5, 0], [0, 1, 0], [0, 0, 1]], "expected"),
        ("intrinsics", [[1, 0, 0], [0, 1, 0], [0, 0, 2]], "expected"),
        ("world_from_camera", np.diag([2.0, 1, 1, 1]).tolist(), "rotation"),
        ("world_from_camera", np.diag([-1.0, 1, 1, 1]).tolist(), "rotation"),
        ("world_from_camera", np.diag([1.0, 1, 1, 2]).tolist(), "rotation"),
        ("world_from_camera", np.full((4, 4), np.inf).tolist(), "infinity"),
        ("world_from_camera", None, "world_from_camera"),
    ],
)
def test_a_malformed_camera_is_refused_with_its_place_and_reason(key, value, complaint):
    d = pinhole().as_dict() | {key: value}
    with pytest.raises(CameraError, match=rf"shot\.cameras\[3\].*{complaint}"):
        Camera.from_dict(d, "shot.cameras[3]")


@pytest.mark.parametrize("d", [{}, {"width": 1}, pinhole().as_dict() | {"fov": 1}, [1, 2], None])
def test_missing_and_unknown_camera_keys_are_refused(d):
    with pytest.raises(CameraError, match="expected the keys width, height"):
        Camera.from_dict(d)


def test_a_point_ahead_is_in_the_middle_and_depth_is_planar():
    pixels, depth = project(pinhole(), np.array([[0.0, 0.0, 2.0], [1.0, 0.0, 2.0]]))
    assert pixels.tolist() == [[32.0, 24.0], [57.0, 24.0]]
    assert depth.tolist() == [2.0, 2.0]


def test_right_is_more_columns_and_down_is_more_rows():
    pixels, _ = project(pinhole(), np.array([[1.0, 0, 5], [-1.0, 0, 5], [0, 1.0, 5], [0, -1.0, 5]]))
    assert pixels[0, 0] > 32 > pixels[1, 0]
    assert pixels[2, 1] > 24 > pixels[3, 1]


def test_points_behind_the_camera_have_no_pixel():
    pixels, depth = project(pinhole(), np.array([[0.0, 0.0, -2.0], [1.0, 1.0, 0.0]]))
    assert np.isnan(pixels).all()
    assert depth.tolist() == [-2.0, 0.0]


def test_projecting_no_points_gives_no_pixels():
    pixels, depth = project(pinhole(), np.zeros((0, 3)))
    assert pixels.shape == (0, 2)
    assert depth.shape == (0,)


@given(cameras, st.floats(0.1, 100), st.floats(0, 1), st.floats(0, 1))
def test_unprojecting_a_pixel_and_projecting_it_returns_to_the_pixel(camera, depth, across, down):
    pixel = np.array([across * camera.width, down * camera.height])
    ray = np.linalg.inv(camera.intrinsics) @ np.array([*pixel, 1.0])
    point = camera.world_from_camera @ np.array([*(ray * depth), 1.0])
    pixels, depths = project(camera, point[None, :3])
    np.testing.assert_allclose(pixels[0], pixel, atol=1e-6 * max(camera.width, camera.height))
    np.testing.assert_allclose(depths[0], depth, rtol=1e-9, atol=1e-9)


@given(cameras, st.integers(1, 3000), st.integers(1, 3000))
def test_a_scaled_camera_sees_the_same_view_on_its_own_grid(camera, width, height):
    point = (camera.world_from_camera @ np.array([0.3, -0.2, 4.0, 1.0]))[None, :3]
    before, _ = project(camera, point)
    after, _ = project(camera.scaled(width, height), point)
    ratio = np.array([width / camera.width, height / camera.height])
    np.testing.assert_allclose(after, before * ratio, rtol=1e-9, atol=1e-6)


def test_blenders_default_lens_has_the_known_focal_length():
    camera = camera_from_blender(LENS, np.eye(4))
    assert (camera.width, camera.height) == (1920, 1080)
    assert camera.intrinsics[0, 0] == pytest.approx(50 / 36 * 1920)
    assert camera.intrinsics[0, 2] == 960
    assert camera.intrinsics[1, 2] == 540


def test_blenders_camera_looks_down_minus_z_with_y_up():
    camera = camera_from_blender(LENS, np.eye(4))
    pixels, depth = project(camera, np.array([[0.0, 0.0, -3.0], [0.1, 0.1, -3.0]]))
    assert depth.tolist() == [3.0, 3.0]
    assert pixels[0].tolist() == [960.0, 540.0]
    assert pixels[1, 0] > 960
    assert pixels[1, 1] < 540


def test_resolution_percentages_are_truncated_not_rounded():
    lens = replace(LENS, resolution_x=101, resolution_y=99, resolution_percentage=99)
    camera = camera_from_blender(lens, np.eye(4))
    assert (camera.width, camera.height) == (99, 98)


def test_auto_fit_of_a_portrait_frame_measures_its_height_with_the_sensors_width():
    lens = replace(LENS, resolution_x=1080, resolution_y=1920)
    camera = camera_from_blender(lens, np.eye(4))
    assert camera.intrinsics[0, 0] == pytest.approx(50 / 36 * 1920)


def test_vertical_fit_uses_the_sensors_height():
    camera = camera_from_blender(replace(LENS, sensor_fit="VERTICAL"), np.eye(4))
    assert camera.intrinsics[1, 1] == pytest.approx(50 / 24 * 1080)


def test_shifting_the_lens_right_and_up_moves_the_centre_left_and_down():
    camera = camera_from_blender(replace(LENS, shift_x=0.1, shift_y=0.1), np.eye(4))
    assert camera.intrinsics[0, 2] == pytest.approx(960 - 192)
    assert camera.intrinsics[1, 2] == pytest.approx(540 + 192)


@pytest.mark.parametrize("scale", [(2, 2, 2), (0.1, 3, 7), (1e-3, 1e-3, 1e-3)])
def test_scale_on_a_camera_changes_nothing(scale):
    matrix = pose((0.3, -1.0, 2.0), (1, 2, 3))
    plain = camera_from_blender(LENS, matrix)
    scaled = camera_from_blender(LENS, matrix @ np.diag([*scale, 1.0]))
    np.testing.assert_allclose(scaled.world_from_camera, plain.world_from_camera, atol=1e-12)


@pytest.mark.parametrize("kind", ["ORTHO", "PANO", "CUSTOM"])
def test_cameras_that_are_no_pinholes_are_refused(kind):
    with pytest.raises(CameraError, match=f"camera type is {kind}.*Perspective"):
        camera_from_blender(replace(LENS, type=kind), np.eye(4))


def test_a_sheared_camera_is_refused_with_the_remedy():
    parent = np.diag([1.0, 3.0, 1.0, 1.0])
    with pytest.raises(CameraError, match="sheared.*apply the parent's scale"):
        camera_from_blender(LENS, parent @ pose((0.4, 0.5, 0.6)))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_mirrored_camera_is_refused_with_the_remedy(axis):
    scale = np.ones(4)
    scale[axis] = -1
    with pytest.raises(CameraError, match="mirrored.*make the scale positive"):
        camera_from_blender(LENS, pose((0.4, 0.5, 0.6)) @ np.diag(scale))


def test_a_camera_of_zero_scale_is_refused():
    with pytest.raises(CameraError, match="scale other than zero"):
        camera_from_blender(LENS, np.diag([1.0, 0.0, 1.0, 1.0]))


def test_a_camera_matrix_with_nan_is_refused():
    with pytest.raises(CameraError, match="matrix_world holds NaN"):
        camera_from_blender(LENS, np.full((4, 4), np.nan))


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("lens", 0.0),
        ("sensor_width", -1.0),
        ("sensor_height", float("nan")),
        ("pixel_aspect_y", 0.0),
        ("shift_x", float("inf")),
        ("sensor_fit", "DIAGONAL"),
        ("resolution_percentage", 0),
    ],
)
def test_impossible_lens_numbers_are_refused(field, value):
    with pytest.raises(CameraError):
        camera_from_blender(replace(LENS, **{field: value}), np.eye(4))
