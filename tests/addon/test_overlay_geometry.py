"""The overlay's lines by hand numbers, and by laws over random cameras, boxes and grounds."""

import math

import numpy as np
import pytest
from addon.stage import front_camera
from hypothesis import given, settings
from hypothesis import strategies as st

from blender_addon.overlay.clipping import NEAR, depth_of, in_front, unprojected
from blender_addon.overlay.ground_grid import MOST_LINES, border_lines, grid_lines, mesh_of
from blender_addon.overlay.picture_marks import (
    AMBER,
    FINE,
    IMPOSSIBLE,
    OUTSIDE,
    RED,
    GroundMark,
    PictureBox,
    PictureView,
    box_lines,
    ground_lines,
    mark_lines,
    standing_at,
    standing_lines,
)
from blender_addon.overlay.scene_lines import NEUTRAL
from blender_addon.overlay.volume_lines import heading_arrow, volume_edges
from pe_runtime.contract.camera import Camera, project
from pe_runtime.contract.model_facts import Volume

PLAYER = Volume((-0.5, -0.25, 0.0), (0.5, 0.25, 2.0))
metres = st.floats(-1e3, 1e3)
points = st.tuples(metres, metres, metres)
pixels = st.floats(-500.0, 500.0)
# Rounded to what a float32 picture position could tell apart anyway.
sides = st.floats(1e-3, 1e6)


def everything_finite(lines):
    numbers = [each.ends for each in lines.strokes] + [each.colours for each in lines.strokes]
    numbers += [each.points for each in lines.dots] + [each.colours for each in lines.dots]
    numbers += [np.array(each.anchor) for each in lines.labels]
    return all(np.isfinite(each).all() for each in numbers)


def colours_of(lines):
    return {tuple(colour[:3]) for each in lines.strokes for colour in each.colours}


@st.composite
def cameras(draw):
    turn, pitch = draw(st.floats(-math.pi, math.pi)), draw(st.floats(-1.5, 1.5))
    forward = np.array(
        [math.cos(turn) * math.cos(pitch), math.sin(turn) * math.cos(pitch), math.sin(pitch)]
    )
    right = np.array([math.sin(turn), -math.cos(turn), 0.0])
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = draw(points)
    focal = draw(st.floats(10.0, 1000.0))
    intrinsics = np.array([[focal, 0.0, 32.0], [0.0, focal, 18.0], [0.0, 0.0, 1.0]])
    return Camera(64, 36, intrinsics, pose)


def test_a_line_through_the_camera_is_cut_at_the_near_plane():
    camera = front_camera()
    eye, forward = camera.world_from_camera[:3, 3], camera.world_from_camera[:3, 2]
    ends = np.array([[eye - 2 * forward, eye + 3 * forward]])
    cut = in_front(camera, ends)
    assert np.allclose(cut, [[eye + NEAR * forward, eye + 3 * forward]])


def test_a_line_behind_the_camera_is_gone_and_one_before_it_whole():
    camera = front_camera()
    behind, before = [(0, -20, 0), (1, -30, 2)], [(0, 2, 0), (1, 3, 2)]
    assert np.array_equal(in_front(camera, np.array([behind, before], float)), [before])


@given(cameras(), st.lists(st.tuples(points, points), max_size=8))
def test_nothing_that_is_kept_lies_behind_any_camera(camera, ends):
    ends = np.array(ends, float).reshape(-1, 2, 3)
    kept = in_front(camera, ends)
    assert np.isfinite(kept).all() and len(kept) <= len(ends)
    assert (depth_of(camera, kept) >= NEAR - 1e-6).all()


@given(cameras(), st.tuples(pixels, pixels), st.floats(0.1, 100.0))
def test_what_is_seen_at_a_pixel_is_projected_to_that_pixel(camera, pixel, depth):
    point = unprojected(camera, np.array(pixel), depth)
    seen, found = project(camera, point[None])
    assert np.allclose(found, depth, rtol=1e-6, atol=1e-6)
    assert np.allclose(seen[0], pixel, atol=1e-3 * (1 + np.abs(camera.world_from_camera).max()))


def test_a_court_has_a_line_for_every_metre():
    lines = grid_lines((-2.0, -1.5), (2.0, 3.0))
    across = sorted(x for (x, _, _), (other, _, _) in lines if x == other)
    along = sorted(y for (_, y, _), (_, other, _) in lines if y == other)
    assert across == [-2, -1, 0, 1, 2] and along == [-1, 0, 1, 2, 3]
    assert (lines[..., 2] == 0).all()


@pytest.mark.parametrize(
    ("width", "mesh"), [(0.5, 0.05), (1.2, 0.05), (2.0, 1.0), (24.0, 1.0), (25.0, 2.0), (1e6, 5e4)]
)
def test_meshes_are_whole_metres_where_there_is_room_for_them(width, mesh):
    assert mesh_of((0.0, 0.0), (width, 0.4)) == pytest.approx(mesh)


@given(st.tuples(metres, metres), st.tuples(sides, sides))
def test_a_grid_of_any_size_has_few_lines_and_stays_on_its_ground(low, size):
    high = low[0] + size[0], low[1] + size[1]
    lines = grid_lines(low, high)
    assert len(lines) <= 2 * (MOST_LINES + 1) and np.isfinite(lines).all()
    assert (lines[..., :2] >= np.array(low) - 1e-6).all()
    assert (lines[..., :2] <= np.array(high) + 1e-6).all()


@pytest.mark.parametrize("high", [(0.0, 5.0), (-3.0, 5.0), (math.nan, 5.0), (math.inf, 5.0)])
def test_ground_that_encloses_nothing_has_no_grid(high):
    assert len(grid_lines((0.0, 0.0), high)) == len(border_lines((0.0, 0.0), high)) == 0


def test_a_turned_volume_has_its_corners_where_they_belong():
    edges = volume_edges(PLAYER, (3.0, 4.0, 0.0), math.pi / 2)
    assert edges.shape == (12, 2, 3)
    assert np.allclose(edges.min(axis=(0, 1)), [2.75, 3.5, 0.0])
    assert np.allclose(edges.max(axis=(0, 1)), [3.25, 4.5, 2.0])
    lengths = sorted(np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1).round(9))
    assert lengths == [0.5] * 4 + [1.0] * 4 + [2.0] * 4


def test_a_heading_of_a_quarter_turn_points_to_minus_x():
    arrow = heading_arrow((1.0, 1.0, 0.0), math.pi / 2, 2.0)
    assert np.allclose(arrow[0], [[1, 1, 0], [-1, 1, 0]])


def test_a_box_frames_its_object_through_the_cameras_eye():
    box = (12.0, 10.0, 20.0, 30.0)
    view = PictureView(front_camera(), (PictureBox("player_1", box),))
    (stroke,) = box_lines(view).strokes
    seen, _ = project(view.camera, stroke.ends.reshape(-1, 3))
    assert np.allclose(seen.min(axis=0), box[:2]) and np.allclose(seen.max(axis=0), box[2:])
    assert [each.text for each in box_lines(view).labels] == ["player_1"]


def test_the_volume_stands_where_the_box_meets_the_ground():
    box = (28.0, 5.0, 36.0, 18.0)
    view = PictureView(front_camera(), (PictureBox("a", box),), {"a": PLAYER})
    foot = standing_at(view.camera, box)
    assert np.allclose(foot, [0.0, -8.0 + 2.5 / 0.28 * 0.96, 0.0])
    (stroke,) = standing_lines(view).strokes
    assert np.allclose(stroke.ends.mean(axis=(0, 1)), foot + (0, 0, 1.0))


def test_a_box_whose_foot_is_in_the_sky_is_drawn_without_a_volume():
    box = PictureBox("a", (10.0, -30.0, 20.0, -10.0), IMPOSSIBLE, "its foot is in the sky")
    view = PictureView(front_camera(), (box,), {"a": PLAYER})
    assert standing_at(view.camera, box.box) is None and standing_lines(view).segments == 0
    lines = box_lines(view)
    assert lines.segments == 4 and everything_finite(lines)
    assert lines.labels[0].text == "its foot is in the sky"


@pytest.mark.parametrize(
    ("verdict", "colour"), [(FINE, NEUTRAL), (OUTSIDE, AMBER), (IMPOSSIBLE, RED)]
)
def test_verdicts_have_their_colours(verdict, colour):
    view = PictureView(
        front_camera(),
        (PictureBox("a", (12.0, 10.0, 20.0, 30.0), verdict, "why"),),
        {"a": PLAYER},
        ground=((-4.0, -4.0), (4.0, 4.0)),
        verdict=verdict,
    )
    for lines in (box_lines(view), standing_lines(view), ground_lines(view)):
        assert colours_of(lines) == {colour[:3]}


def test_a_ground_point_shows_how_many_pixels_it_misses_by():
    camera = front_camera()
    seen, _ = project(camera, np.array([[1.0, 2.0, 0.0]]))
    mark = GroundMark("P", (seen[0, 0] + 3.0, seen[0, 1] + 4.0), (1.0, 2.0))
    lines = mark_lines(PictureView(camera, marks=(mark,)))
    assert [each.text for each in lines.labels] == ["P: 5.0 px"]
    way = lines.strokes[1].ends[0]
    ends, _ = project(camera, way)
    assert np.allclose(ends, [mark.pixel, seen[0]]) and colours_of(lines) >= {AMBER[:3]}


def test_a_ground_point_behind_the_camera_says_so():
    mark = GroundMark("P", (10.0, 10.0), (0.0, -50.0))
    lines = mark_lines(PictureView(front_camera(), marks=(mark,)))
    assert [each.text for each in lines.labels] == ["P: behind the camera"]
    assert everything_finite(lines)


def test_a_camera_that_only_looks_on_shows_boxes_and_points_but_no_ground():
    view = PictureView(
        front_camera(),
        (PictureBox("a", (12.0, 10.0, 20.0, 30.0)),),
        {"a": PLAYER},
        ((-4.0, -4.0), (4.0, 4.0)),
        (GroundMark("P", (10.0, 10.0), (0.0, 0.0)),),
        is_known=False,
    )
    assert ground_lines(view).segments == standing_lines(view).segments == 0
    assert box_lines(view).segments == 4 and mark_lines(view).segments == 2
    assert [each.text for each in mark_lines(view).labels] == ["P"]


def test_what_is_wrong_with_the_camera_stands_in_the_corner_of_the_picture():
    view = PictureView(front_camera(), verdict=OUTSIDE, warning="the camera is too low")
    (words,) = box_lines(view).labels
    seen, _ = project(view.camera, np.array([words.anchor]))
    assert words.text == "the camera is too low" and np.allclose(seen, 0.0, atol=1e-9)
    assert words.colour == AMBER


@settings(deadline=None)
@given(
    cameras(),
    st.tuples(pixels, pixels, pixels, pixels),
    st.tuples(st.tuples(metres, metres), st.tuples(metres, metres)),
    st.tuples(metres, metres),
)
def test_no_camera_box_ground_or_point_makes_a_number_that_cannot_be_drawn(
    camera, box, ground, spot
):
    view = PictureView(
        camera,
        (PictureBox("a", box),),
        {"a": PLAYER},
        ground,
        (GroundMark("P", box[:2], spot),),
    )
    for make in (ground_lines, box_lines, standing_lines, mark_lines):
        lines = make(view)
        assert everything_finite(lines) and lines.segments <= 2 * MOST_LINES + 8
        for stroke in lines.strokes:
            assert (depth_of(camera, stroke.ends) >= NEAR - 1e-6).all() or make is mark_lines
