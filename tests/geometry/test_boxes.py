import itertools

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from small_world import camera, look_at

from pe_runtime.contract.camera import project
from pe_runtime.geometry.boxes import (
    box_in_image,
    corners,
    intersect_box,
    visible_box_in_image,
)
from pe_runtime.geometry.cameras import Cameras

LOW, HIGH = (-1.0, -2.0, 0.0), (1.5, 1.0, 2.0)
NEAR = 0.1

halves = st.integers(-8, 8).map(lambda n: n / 2)
triples = st.tuples(halves, halves, halves)
numbers = st.floats(-4.0, 4.0).map(lambda x: round(x, 3))


def meet(origin, direction, low=LOW, high=HIGH, near=NEAR):
    """Entry, exit and hit of one ray, as plain numbers."""
    rows = [torch.tensor([each], dtype=torch.float64) for each in (origin, direction)]
    box = [torch.tensor(each, dtype=torch.float64) for each in (low, high)]
    entry, leave, hit = intersect_box(*rows, *box, near)
    return float(entry), float(leave), bool(hit)


def march(origin, direction, low=LOW, high=HIGH, near=NEAR, end=40.0, count=100_001):
    """The twin: walk along the ray in small steps and note where it is strictly inside."""
    t = np.linspace(near, end, count)
    points = np.asarray(origin)[:, None] + np.asarray(direction)[:, None] * t
    low, high = np.asarray(low)[:, None], np.asarray(high)[:, None]
    inside = t[((points > low) & (points < high)).all(axis=0)]
    step = t[1] - t[0]
    return (inside[0], inside[-1], step) if len(inside) else (None, None, step)


@pytest.mark.parametrize(
    ("origin", "direction", "wanted"),
    [
        ((-3.0, 0.0, 1.0), (1.0, 0.0, 0.0), (2.0, 4.5)),
        ((-3.0, 0.0, 1.0), (2.0, 0.0, 0.0), (1.0, 2.25)),
        ((0.0, 0.0, 5.0), (0.0, 0.0, -1.0), (3.0, 5.0)),
        ((-2.0, -3.0, 1.0), (1.0, 1.0, 0.0), (1.0, 3.5)),
    ],
)
def test_rays_enter_and_leave_where_a_drawing_says(origin, direction, wanted):
    entry, leave, hit = meet(origin, direction)
    assert hit
    assert (entry, leave) == pytest.approx(wanted)


@pytest.mark.parametrize("axis", range(3))
def test_a_ray_parallel_to_a_slab_and_outside_it_misses(axis):
    origin = [0.2, 0.2, 0.5]
    origin[axis] = 9.0
    direction = [1.0, 1.0, 1.0]
    direction[axis] = 0.0
    assert meet(origin, direction) == (0.0, 0.0, False)


def test_a_camera_inside_enters_at_the_near_distance():
    assert meet((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)) == pytest.approx((NEAR, 1.5, True))


def test_the_part_of_a_box_before_the_near_distance_does_not_count():
    assert meet((-3.0, 0.0, 1.0), (1.0, 0.0, 0.0), near=3.0) == pytest.approx((3.0, 4.5, True))
    assert meet((-3.0, 0.0, 1.0), (1.0, 0.0, 0.0), near=4.5) == (0.0, 0.0, False)


def test_a_box_behind_the_camera_is_missed():
    assert not meet((-3.0, 0.0, 1.0), (-1.0, 0.0, 0.0))[2]


def test_a_ray_that_touches_an_edge_from_outside_passes_through_nothing():
    # Through the edge x = -1, y = -2 at a slant, outside everywhere else.
    assert not meet((-2.0, -1.0, 1.0), (1.0, -1.0, 0.0))[2]


def test_a_ray_along_an_edge_passes_through_nothing():
    assert not meet((-3.0, -2.0, 0.0), (1.0, 0.0, 0.0))[2]


@pytest.mark.parametrize("height", [LOW[2], HIGH[2]])
def test_a_ray_along_a_face_passes_through_nothing(height):
    assert not meet((-3.0, 0.0, height), (1.0, 0.0, 0.0))[2]


def test_a_ray_just_inside_a_face_is_a_hit():
    assert meet((-3.0, 0.0, 1e-9), (1.0, 0.0, 0.0)) == pytest.approx((2.0, 4.5, True))


@given(triples, triples)
def test_a_flat_box_holds_nothing(origin, direction):
    assert not meet(origin, direction, low=(-1.0, -2.0, 0.5), high=(1.5, 1.0, 0.5))[2]


@given(triples, triples)
def test_a_zero_direction_or_any_other_gives_no_nan(origin, direction):
    entry, leave, hit = meet(origin, direction)
    assert np.isfinite([entry, leave]).all()
    assert hit == (leave > entry)
    assert entry >= NEAR or not hit


@given(triples, triples)
def test_an_inverted_box_holds_nothing(origin, direction):
    assert meet(origin, direction, low=HIGH, high=LOW) == (0.0, 0.0, False)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("slant", [1e-20, 1e-170, -1e-200])
def test_a_ray_almost_parallel_to_a_slab_has_the_passage_and_gradients_of_a_parallel_one(
    dtype, slant
):
    low, high = (torch.tensor(each, dtype=dtype) for each in (LOW, HIGH))
    origins = torch.tensor([[-3.0, 0.5, 1.0]], dtype=dtype, requires_grad=True)
    directions = torch.tensor([[1.0, slant, 0.0]], dtype=dtype, requires_grad=True)
    entry, leave, hit = intersect_box(origins, directions, low, high, NEAR)
    assert hit.item() and (entry.item(), leave.item()) == (2.0, 4.5)
    for slope in torch.autograd.grad(entry.sum() + leave.sum(), (origins, directions)):
        assert torch.isfinite(slope).all()


def test_a_ray_that_does_not_move_hits_nothing_even_inside():
    assert meet((0.0, 0.0, 1.0), (0.0, 0.0, 0.0)) == (0.0, 0.0, False)


@given(st.tuples(numbers, numbers, numbers), st.tuples(numbers, numbers, numbers))
def test_hits_agree_with_walking_along_the_ray(origin, direction):
    if np.linalg.norm(direction) < 0.3:
        return
    first, last, step = march(origin, direction)
    entry, leave, hit = meet(origin, direction)
    if first is None:
        assert not hit or leave - entry <= 2 * step or entry >= 40.0
        return
    assert hit
    assert entry == pytest.approx(first, abs=1.01 * step)
    assert leave == pytest.approx(min(last, leave), abs=1.01 * step)


@given(st.tuples(numbers, numbers, numbers), st.tuples(numbers, numbers, numbers))
def test_entry_and_exit_lie_on_the_surface(origin, direction):
    entry, leave, hit = meet(origin, direction, near=-100.0)
    if not hit:
        return
    low, high = np.array(LOW), np.array(HIGH)
    for t in (entry, leave):
        if abs(t) >= 100.0:
            continue
        point = np.asarray(origin) + t * np.asarray(direction)
        assert (point >= low - 1e-6).all() and (point <= high + 1e-6).all()
        assert min(np.abs(point - low).min(), np.abs(point - high).min()) < 1e-6


def test_many_rays_at_once_give_what_each_gives_alone():
    generator = torch.Generator().manual_seed(0)
    origins = torch.randn(50, 3, generator=generator, dtype=torch.float64) * 1.5
    directions = torch.randn(50, 3, generator=generator, dtype=torch.float64)
    box = torch.tensor(LOW).double(), torch.tensor(HIGH).double()
    together = intersect_box(origins, directions, *box, NEAR)
    assert 10 <= int(together[2].sum()) <= 40
    for ray in range(50):
        alone = intersect_box(origins[ray : ray + 1], directions[ray : ray + 1], *box, NEAR)
        assert all(torch.equal(a[0], b[ray]) for a, b in zip(alone, together, strict=True))


def test_there_are_eight_different_corners():
    found = {tuple(c) for c in corners(torch.tensor(LOW), torch.tensor(HIGH)).tolist()}
    assert found == set(itertools.product(*zip(LOW, HIGH, strict=True)))


def test_the_box_in_the_image_is_that_of_the_projected_corners():
    views = [camera(0.3), camera(-0.4, distance=7.0)]
    places = np.array([[0.5, 0.2, 0.0], [-0.8, 1.0, 0.0]])
    low, high = (-0.4, -0.3, 0.0), (0.5, 0.4, 1.7)
    boxes, ahead = box_in_image(
        Cameras.stack(views),
        torch.tensor(places, dtype=torch.float32),
        torch.tensor(low),
        torch.tensor(high),
    )
    assert ahead.all()
    for box, view, place in zip(boxes.tolist(), views, places, strict=True):
        world = np.array(list(itertools.product(*zip(low, high, strict=True)))) + place
        pixels, _ = project(view, world)
        assert box == pytest.approx([*pixels.min(axis=0), *pixels.max(axis=0)], abs=1e-3)


def test_a_volume_that_reaches_behind_the_camera_has_no_box():
    view = look_at((0.0, -3.0, 1.0), (0.0, 0.0, 1.0))
    low, high = torch.tensor([-0.5, -0.5, 0.0]), torch.tensor([0.5, 0.5, 2.0])
    places = torch.tensor([[0.0, 0.0, 0.0], [0.0, -3.2, 0.0], [0.0, -9.0, 0.0]])
    _, ahead = box_in_image(Cameras.stack([view] * 3), places, low, high)
    assert ahead.tolist() == [True, False, False]


def visible(view, place, low, high, heading=None):
    headings = None if heading is None else torch.tensor([heading])
    boxes, seen = visible_box_in_image(
        Cameras.stack([view]),
        torch.tensor([place]),
        torch.tensor(low),
        torch.tensor(high),
        headings,
    )
    return boxes[0].tolist(), bool(seen)


def slow_visible(view, place, low, high, heading=0.0):
    """The twin: corners and edge points one by one, those behind the camera left out."""
    ends = list(itertools.product(*zip(low, high, strict=True)))
    points = [np.array(end) for end in ends]
    for first, second in itertools.combinations(ends, 2):
        if sum(a != b for a, b in zip(first, second, strict=True)) == 1:
            points += [
                np.array(first) * (1 - n / 6) + np.array(second) * n / 6 for n in range(1, 6)
            ]
    assert len(points) == 68
    u, v = [], []
    turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    for point in points:
        world = np.array([*(turn @ point[:2]), point[2]]) + place
        pixels, depth = project(view, world[None])
        if depth[0] > 0:
            u.append(min(max(pixels[0, 0], 0), view.width))
            v.append(min(max(pixels[0, 1], 0), view.height))
    return (min(u), min(v), max(u), max(v)) if u else None


@given(st.tuples(numbers, numbers, st.floats(-1.0, 1.0)), st.floats(0.0, 6.3), st.floats(-3.0, 3.0))
def test_the_visible_box_is_that_of_the_outline_s_points_before_the_camera(place, turn, heading):
    view, low, high = camera(turn, distance=3.0), (-1.2, -0.4, 0.0), (0.9, 1.1, 1.5)
    wanted = slow_visible(view, place, low, high, np.float32(heading))
    found, seen = visible(view, place, low, high, heading)
    assert seen == (wanted is not None)
    if seen:
        assert found == pytest.approx(wanted, abs=1e-3)


def test_a_volume_around_the_camera_fills_the_picture():
    view = camera()
    found, seen = visible(view, (0.0, 0.0, 0.0), (-50.0,) * 3, (50.0,) * 3)
    assert seen
    assert found == [0.0, 0.0, view.width, view.height]


def test_edge_points_show_what_corners_behind_the_camera_do_not():
    # A long floor: its near corners lie behind, its far ones at the horizon.
    view = look_at((0.0, 0.0, 1.0), (0.0, 10.0, 1.0))
    found, _ = visible(view, (0.0, 0.0, 0.0), (-0.1, -30.0, -0.1), (0.1, 30.0, 0.0))
    assert found[3] - found[1] > 2


def test_a_volume_behind_the_camera_is_not_seen():
    view = look_at((0.0, -3.0, 1.0), (0.0, 0.0, 1.0))
    assert not visible(view, (0.0, -9.0, 0.0), (-0.5, -0.5, 0.0), (0.5, 0.5, 2.0))[1]


def test_a_volume_beside_the_picture_has_no_area():
    view = look_at((0.0, -3.0, 1.0), (0.0, 0.0, 1.0))
    found, seen = visible(view, (40.0, 3.0, 0.0), (-0.5, -0.5, 0.0), (0.5, 0.5, 2.0))
    assert seen
    assert found[0] == found[2] == view.width


def test_a_whole_volume_in_the_picture_has_the_same_box_either_way():
    view = camera(0.3)
    rows = torch.tensor([[0.1, 0.2, 0.0]]), torch.tensor([-0.2] * 3), torch.tensor([0.3] * 3)
    wanted, _ = box_in_image(Cameras.stack([view]), *rows)
    found, _ = visible_box_in_image(Cameras.stack([view]), *rows)
    torch.testing.assert_close(found, wanted)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e6])
def test_a_volume_in_front_of_the_camera_is_so_at_every_world_scale(scale):
    low, high = (torch.tensor(each, dtype=torch.float64) * scale for each in (LOW, HIGH))
    place = torch.tensor([[0.0, 0.0, 0.0]], dtype=torch.float64)
    for distance, wanted in ((2.2, True), (1.9, False)):
        view = look_at((0.0, -distance * scale, scale), (0.0, 0.0, scale))
        _, ahead = box_in_image(Cameras.stack([view]), place, low, high)
        assert ahead.tolist() == [wanted]
