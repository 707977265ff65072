import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from small_world import HEIGHT, WIDTH, camera, look_at

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.camera import project as project_one
from pe_runtime.geometry.cameras import (
    Cameras,
    ground_from_pixels,
    project,
    ray_directions,
)

within = st.floats(-1.0, 1.0)


@st.composite
def views(draw):
    """Cameras anywhere above the ground, looking anywhere but straight up or down."""
    position = (8 * draw(within), -6 + 4 * draw(within), 2.2 + 2 * draw(within))
    target = (2 * draw(within), 1 + 2 * draw(within), draw(st.floats(0.0, 2.0)))
    return look_at(position, target, focal=draw(st.floats(10.0, 200.0)))


@given(st.lists(views(), min_size=1, max_size=3), st.floats(0.01, 100.0))
def test_a_point_along_a_pixel_s_ray_projects_to_that_pixel_at_that_depth(seen_from, depth):
    cameras = Cameras.stack(seen_from)
    pixels = torch.tensor([[0.5, 0.5], [WIDTH - 0.5, HEIGHT - 0.5], [-40.0, 3.25]])
    frame = torch.arange(len(seen_from)).repeat_interleave(3)
    directions = ray_directions(cameras, frame, pixels.repeat(len(seen_from), 1))
    points = cameras.centres[frame] + depth * directions
    found, depths = project(cameras, points.reshape(-1, 3, 3))
    torch.testing.assert_close(found, pixels.double().expand_as(found), atol=1e-6, rtol=0)
    torch.testing.assert_close(depths, torch.full_like(depths, depth), atol=1e-9, rtol=1e-9)


@given(views(), st.integers(0, 1000))
def test_projection_agrees_with_that_of_the_contract(view, seed):
    points = np.random.default_rng(seed).uniform(-5, 5, (6, 3))
    pixels, depths = project(Cameras.stack([view]), torch.from_numpy(points)[None])
    wanted_pixels, wanted_depths = project_one(view, points)
    np.testing.assert_allclose(depths[0].numpy(), wanted_depths, atol=1e-9)
    ahead = wanted_depths > 1e-3
    np.testing.assert_allclose(pixels[0].numpy()[ahead], wanted_pixels[ahead], rtol=1e-9, atol=1e-6)


def test_points_behind_the_camera_have_a_negative_depth_and_finite_pixels():
    view = look_at((0.0, -3.0, 1.0), (0.0, 0.0, 1.0))
    points = torch.tensor([[[0.3, -5.0, 1.2], [0.0, -3.0, 1.0]]])
    pixels, depths = project(Cameras.stack([view]), points)
    assert depths[0].tolist() == pytest.approx([-2.0, 0.0])
    assert torch.isfinite(pixels).all()


def test_the_middle_ray_looks_forward_and_one_metre_of_depth_per_unit():
    view = camera()
    middle = torch.tensor([[view.intrinsics[0, 2], view.intrinsics[1, 2]]])
    direction = ray_directions(Cameras.stack([view]), torch.zeros(1, dtype=torch.long), middle)
    np.testing.assert_allclose(direction[0].numpy(), view.world_from_camera[:3, 2], atol=1e-12)


@given(views(), st.floats(-4.0, 4.0), st.floats(-2.0, 6.0))
def test_a_ground_point_is_found_again_from_its_pixel(view, x, y):
    world = np.array([[x, y, 0.0]])
    pixel, depth = project_one(view, world)
    if depth[0] < 0.05:
        return
    ground, meets = ground_from_pixels(Cameras.stack([view]), torch.from_numpy(pixel)[None])
    assert bool(meets)
    np.testing.assert_allclose(ground[0, 0].numpy(), world[0], atol=1e-6)
    assert ground[0, 0, 2] == 0


def level():
    """One metre up, looking along +y; the horizon is the row of the principal point."""
    return look_at((0.0, 0.0, 1.0), (0.0, 1.0, 1.0))


def feet(view, *pixels):
    return ground_from_pixels(Cameras.stack([view]), torch.tensor([pixels], dtype=torch.float64))


def test_a_foot_below_the_horizon_by_hand():
    view = level()
    horizon, focal = view.intrinsics[1, 2], view.intrinsics[1, 1]
    ground, meets = feet(view, (view.intrinsics[0, 2], horizon + focal / 4))
    assert bool(meets)
    assert ground[0, 0].tolist() == pytest.approx([0.0, 4.0, 0.0])


@pytest.mark.parametrize("above", [0.0, 1e-6, 0.5, 5.0])
def test_a_foot_at_or_above_the_horizon_is_no_place(above):
    ground, meets = feet(level(), (WIDTH / 2, level().intrinsics[1, 2] - above))
    assert not meets.any()
    assert ground.tolist() == [[[0.0, 0.0, 0.0]]]


def test_a_foot_just_below_the_horizon_is_far_but_finite():
    ground, meets = feet(level(), (WIDTH / 2, level().intrinsics[1, 2] + 1e-3))
    assert meets.all()
    assert 1e4 < ground[0, 0, 1] < 1e5


def test_a_camera_below_the_ground_sees_no_ground_in_front_of_it():
    below = look_at((0.0, 0.0, -1.0), (0.0, 3.0, -1.5))
    _, meets = feet(below, *[(WIDTH / 2, v) for v in (0.0, HEIGHT / 2, HEIGHT - 1.0)])
    assert not meets.any()


def test_a_camera_on_the_ground_sees_none_of_it():
    _, meets = feet(look_at((0.0, 0.0, 0.0), (0.0, 3.0, -0.5)), (WIDTH / 2, HEIGHT / 2))
    assert not meets.any()


def test_a_camera_that_looks_up_finds_nothing_behind_itself():
    up = look_at((0.0, 0.0, 1.0), (0.0, 1.0, 4.0))
    _, meets = feet(up, *[(WIDTH / 2, v) for v in (0.0, HEIGHT / 2, HEIGHT - 0.5)])
    assert not meets.any()


def test_nan_pixels_are_no_place():
    ground, meets = feet(level(), (float("nan"), 12.0), (3.0, float("inf")))
    assert not meets.any()
    assert torch.isfinite(ground).all()


def test_no_pixels_give_no_points():
    ground, meets = ground_from_pixels(Cameras.stack([level()] * 2), torch.zeros(2, 0, 2))
    assert ground.shape == (2, 0, 3) and meets.shape == (2, 0)


def test_every_frame_uses_its_own_camera():
    seen_from = [camera(0.3), camera(-0.5, distance=7.0), level()]
    world = np.array([[0.4, 2.0, 0.0]])
    pixels = torch.stack([torch.from_numpy(project_one(v, world)[0]) for v in seen_from])
    ground, meets = ground_from_pixels(Cameras.stack(seen_from), pixels)
    assert meets.all()
    torch.testing.assert_close(
        ground[:, 0], torch.from_numpy(world).expand(3, 3), atol=1e-9, rtol=0
    )


def test_far_from_the_origin_digits_survive():
    view = camera()
    moved = view.world_from_camera.copy()
    moved[:2, 3] += 1e6
    far = Camera(view.width, view.height, view.intrinsics, moved)
    near_ground, _ = feet(view, (10.0, 15.0))
    far_ground, meets = feet(far, (10.0, 15.0))
    assert meets.all()
    offset = far_ground - near_ground - torch.tensor([1e6, 1e6, 0.0], dtype=torch.float64)
    assert offset.abs().max() < 1e-8


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_rays_keep_their_digits_where_networks_multiply_in_bfloat16(dtype):
    cameras, frame = Cameras.stack([camera()]), torch.zeros(3, dtype=torch.long)
    pixels = torch.tensor([[0.5, 0.5], [7.25, 3.5], [30.0, 15.0]])
    wanted = ray_directions(cameras, frame, pixels, dtype)
    with torch.autocast("cpu", torch.bfloat16):
        found = ray_directions(cameras, frame, pixels, dtype)
    assert torch.equal(found, wanted)
