"""Camera moves: what they keep, where they stop, and that nothing at all moves nothing."""

import numpy as np
import pytest
import small_world

from pe_runtime.contract.camera import project
from pe_runtime.play.camera_moves import (
    LOWEST,
    NEAREST,
    CameraMove,
    moved_camera,
    resized_camera,
)

PIVOT = np.array([0.4, -0.3, 0.85])
AMOUNTS = (-35.0, -1.0, 0.4, 20.0)


def views():
    """Cameras at several places, tilted and with the principal point off the middle."""
    return [
        small_world.camera(azimuth, height=height)
        for azimuth, height in ((0.0, 1.6), (0.9, 0.7), (-2.5, 3.0))
    ]


def place(camera):
    return camera.world_from_camera[:3, 3]


def pixel(camera, point=PIVOT):
    return project(camera, point[None])[0][0]


def level(camera):
    """How far the camera's right axis points out of the horizontal."""
    return camera.world_from_camera[2, 0]


@pytest.mark.parametrize("degrees", AMOUNTS)
def test_an_orbit_keeps_height_distance_horizon_and_the_pivots_pixel(degrees):
    for camera in views():
        moved = moved_camera(camera, PIVOT, CameraMove(orbit=degrees))
        assert place(moved)[2] == pytest.approx(place(camera)[2])
        before, after = (np.linalg.norm(place(each) - PIVOT) for each in (camera, moved))
        assert after == pytest.approx(before)
        assert level(moved) == pytest.approx(level(camera), abs=1e-12)
        np.testing.assert_allclose(pixel(moved), pixel(camera), atol=1e-9)
        turned = np.degrees(
            np.arccos(
                np.clip(
                    np.sum(camera.world_from_camera[:3, :3] * moved.world_from_camera[:3, :3]) / 2
                    - 0.5,
                    -1,
                    1,
                )
            )
        )
        assert turned == pytest.approx(abs(degrees), abs=1e-6)


def test_a_positive_orbit_goes_to_the_cameras_own_right():
    for camera in views():
        moved = moved_camera(camera, PIVOT, CameraMove(orbit=5.0))
        assert (place(moved) - place(camera)) @ camera.world_from_camera[:3, 0] > 0


@pytest.mark.parametrize("metres", [-0.5, 0.3, 2.0])
def test_rising_keeps_ground_position_horizon_and_the_pivots_row(metres):
    for camera in views():
        moved = moved_camera(camera, PIVOT, CameraMove(rise=metres))
        rise = place(moved) - place(camera)
        np.testing.assert_allclose(rise, [0.0, 0.0, metres], atol=1e-12)
        assert level(moved) == pytest.approx(level(camera), abs=1e-12)
        assert pixel(moved)[1] == pytest.approx(pixel(camera)[1], abs=1e-9)


def test_lowering_stops_above_the_ground_and_leaves_what_is_below_it():
    camera = small_world.camera(height=1.0)
    assert place(moved_camera(camera, PIVOT, CameraMove(rise=-5.0)))[2] == LOWEST
    buried = small_world.camera(height=-0.5)
    assert place(moved_camera(buried, PIVOT, CameraMove(rise=-5.0)))[2] == -0.5


@pytest.mark.parametrize("metres", [-3.0, 0.5, 2.0])
def test_a_dolly_goes_straight_to_the_pivot_and_keeps_its_pixel(metres):
    for camera in views():
        moved = moved_camera(camera, PIVOT, CameraMove(dolly=metres))
        before, after = (np.linalg.norm(place(each) - PIVOT) for each in (camera, moved))
        assert before - after == pytest.approx(metres)
        np.testing.assert_allclose(pixel(moved), pixel(camera), atol=1e-9)
        np.testing.assert_array_equal(
            moved.world_from_camera[:3, :3], camera.world_from_camera[:3, :3]
        )


def test_a_dolly_stops_before_the_pivot_and_never_pushes_a_near_camera_away():
    camera = small_world.camera()
    stopped = moved_camera(camera, PIVOT, CameraMove(dolly=100.0))
    assert np.linalg.norm(place(stopped) - PIVOT) == pytest.approx(NEAREST)
    near = moved_camera(camera, place(camera) + [0.0, 0.2, 0.0], CameraMove(dolly=1.0))
    np.testing.assert_array_equal(place(near), place(camera))
    on_it = moved_camera(camera, place(camera), CameraMove(dolly=-1.0))
    np.testing.assert_array_equal(place(on_it), place(camera))


def test_no_move_is_the_very_same_camera_also_after_going_there_and_back():
    camera = small_world.camera(0.3)
    assert moved_camera(camera, PIVOT, CameraMove()) is camera
    there = CameraMove(orbit=5.0, rise=0.25, dolly=0.5)
    assert moved_camera(camera, PIVOT, there + there * -1.0) is camera


def test_a_share_of_a_move_is_a_share_of_each_of_its_parts():
    assert CameraMove(20.0, 1.0, -2.0) * 0.5 == CameraMove(10.0, 0.5, -1.0)


def test_another_size_of_the_same_shape_is_the_scaled_camera():
    camera = small_world.camera()
    resized = resized_camera(camera, 2 * camera.width, 2 * camera.height)
    np.testing.assert_allclose(resized.intrinsics, camera.scaled(64, 32).intrinsics, atol=1e-12)


def test_a_taller_picture_shows_more_above_and_below_and_stretches_nothing():
    camera = small_world.camera()
    tall = resized_camera(camera, camera.width, camera.height + 10)
    assert (tall.width, tall.height) == (camera.width, camera.height + 10)
    np.testing.assert_array_equal(
        tall.intrinsics[[0, 1], [0, 1]], camera.intrinsics[[0, 1], [0, 1]]
    )
    np.testing.assert_allclose(pixel(tall) - pixel(camera), [0.0, 5.0], atol=1e-9)
