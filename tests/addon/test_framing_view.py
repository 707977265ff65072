"""From the mouse in a 3D view to a pixel of the picture, and what the mouse then does."""

import numpy as np
import pytest

from blender_addon.framing.box_drawing import BoxDrawing
from blender_addon.framing.point_placing import PointPlacing
from blender_addon.framing.tool_events import CANCELLED, DONE, PASSED_ON, RUNNING, respond
from blender_addon.framing.view_mapping import PictureFrame, fitted_between, frame_in_view

SIZE = (64, 36)
NAMES = ["player_1", "player_2"]


def send(tool, *events, reach=3.0):
    """Feed `(type, value, u, v)` events; the answer to the last one."""
    answers = [respond(tool, kind, value, (u, v), reach) for kind, value, u, v in events]
    return answers[-1]


def drag(left, top, right, bottom):
    return (
        ("LEFTMOUSE", "PRESS", left, top),
        ("MOUSEMOVE", "NOTHING", (left + right) / 2, (top + bottom) / 2),
        ("LEFTMOUSE", "RELEASE", right, bottom),
    )


def key(name):
    return (name, "PRESS", 0.0, 0.0)


def test_the_upper_left_corner_of_the_frame_is_pixel_zero_and_rows_go_down():
    frame = PictureFrame(100.0, 50.0, 228.0, 122.0, *SIZE)
    assert frame.to_picture(100.0, 122.0) == (0.0, 0.0)
    assert frame.to_picture(228.0, 50.0) == SIZE
    assert frame.to_picture(110.0, 112.0) == (5.0, 5.0)
    assert frame.zoom == 2.0


def test_the_corners_and_the_middle_of_the_frame_are_those_of_the_picture():
    frame = PictureFrame(13.0, -7.0, 411.0, 217.0, *SIZE)
    width, height = SIZE
    assert frame.to_picture(13.0, 217.0) == pytest.approx((0, 0))
    assert frame.to_picture(411.0, -7.0) == pytest.approx((width, height))
    assert frame.to_picture(212.0, 105.0) == pytest.approx((width / 2, height / 2))
    assert frame.to_picture(13.0 - 199.0, 105.0) == pytest.approx((-width / 2, height / 2))


def look_ahead(focal=2.0, shift=0.0):
    """A projection that looks down -z, as Blender's cameras do."""
    matrix = np.zeros((4, 4))
    matrix[0, 0], matrix[1, 1], matrix[2, 2], matrix[3, 2] = focal, focal, -1.0, -1.0
    matrix[0, 2] = shift
    return matrix


CORNERS = np.array([(0.32, 0.18, -1), (0.32, -0.18, -1), (-0.32, -0.18, -1), (-0.32, 0.18, -1.0)])


def test_the_cameras_frame_is_found_in_the_view():
    frame = frame_in_view(CORNERS, look_ahead(), (1000, 1000), SIZE)
    assert (frame.left, frame.right) == pytest.approx((180.0, 820.0))
    assert (frame.bottom, frame.top) == pytest.approx((320.0, 680.0))


def test_a_panned_view_moves_the_frame_along():
    still = frame_in_view(CORNERS, look_ahead(), (1000, 1000), SIZE)
    panned = frame_in_view(CORNERS, look_ahead(shift=-0.2), (1000, 1000), SIZE)
    assert panned.left - still.left == pytest.approx(100.0)
    middle = np.array([still.left + still.right, still.bottom + still.top]) / 2
    assert panned.to_picture(*middle + (100.0, 0.0)) == pytest.approx(np.array(SIZE) / 2)


def test_a_frame_behind_the_view_or_of_no_size_is_none():
    assert frame_in_view(-CORNERS, look_ahead(), (1000, 1000), SIZE) is None
    assert frame_in_view(CORNERS * (1e-5, 1e-5, 1), look_ahead(), (1000, 1000), SIZE) is None


def test_boxes_are_drawn_one_after_the_other_in_any_direction():
    tool = BoxDrawing(NAMES, {}, SIZE)
    assert tool.current == "player_1"
    assert send(tool, *drag(20, 30, 12, 10)) == RUNNING
    assert tool.current == "player_2"
    assert send(tool, *drag(40, 11, 49, 29)) == DONE
    assert tool.boxes == {"player_1": (12, 10, 20, 30), "player_2": (40, 11, 49, 29)}


def test_a_box_in_the_hand_is_seen_while_it_is_dragged_and_ends_at_the_border():
    tool = BoxDrawing(NAMES, {}, SIZE)
    send(tool, ("LEFTMOUSE", "PRESS", 50, 20), ("MOUSEMOVE", "NOTHING", 99, 99))
    assert tool.boxes == {"player_1": (50, 20, 64, 36)} and tool.dragging


def test_a_click_draws_nothing_and_keeps_the_turn():
    tool = BoxDrawing(NAMES, {"player_1": (1, 2, 9, 9)}, SIZE)
    assert send(tool, *drag(20, 20, 20.5, 20.5)) == RUNNING
    assert tool.boxes == {"player_1": (1, 2, 9, 9)} and tool.current == "player_1"


def test_escape_first_drops_the_box_in_the_hand_and_then_cancels():
    tool = BoxDrawing(NAMES, {"player_1": (1, 2, 9, 9)}, SIZE)
    send(tool, ("LEFTMOUSE", "PRESS", 20, 20), ("MOUSEMOVE", "NOTHING", 30, 30))
    assert send(tool, key("ESC")) == RUNNING
    assert tool.boxes == {"player_1": (1, 2, 9, 9)}
    assert send(tool, key("ESC")) == CANCELLED


def test_tab_goes_on_and_x_says_that_an_object_is_not_in_the_picture():
    tool = BoxDrawing(NAMES, {"player_1": (1, 2, 9, 9), "player_2": (3, 3, 9, 9)}, SIZE)
    assert send(tool, key("TAB")) == RUNNING
    assert send(tool, key("X")) == DONE
    assert tool.boxes == {"player_1": (1, 2, 9, 9)}


def test_enter_ends_a_tool_with_what_there_is():
    tool = BoxDrawing(NAMES, {}, SIZE)
    send(tool, *drag(2, 2, 9, 9))
    assert send(tool, key("RET")) == DONE
    assert list(tool.boxes) == ["player_1"]


def test_navigating_the_view_is_passed_on_and_changes_nothing():
    tool = BoxDrawing(NAMES, {}, SIZE)
    for kind in ("WHEELUPMOUSE", "MIDDLEMOUSE", "TRACKPADPAN"):
        assert send(tool, key(kind)) == PASSED_ON
    assert tool.boxes == {} and tool.current == "player_1"


def test_other_keys_do_nothing():
    assert send(BoxDrawing(NAMES, {}, SIZE), key("G")) == RUNNING


def test_points_without_a_place_are_set_first_and_then_new_ones_come():
    tool = PointPlacing([(5.0, 5.0), None], 0, SIZE)
    send(tool, *drag(20, 20, 21, 22))
    send(tool, *drag(30, 10, 30, 10))
    assert tool.points == [(5.0, 5.0), (21, 22), (30, 10)]
    assert tool.sources == [0, 1, None]


def test_a_point_within_reach_is_dragged_and_stays_in_the_picture():
    tool = PointPlacing([(5.0, 5.0), (40.0, 20.0)], 0, SIZE)
    send(tool, *drag(41, 21, 99, -9))
    assert tool.points == [(5.0, 5.0), (64.0, 0.0)] and tool.active == 1


def test_a_point_in_the_hand_can_be_put_back():
    tool = PointPlacing([(5.0, 5.0), None], 0, SIZE)
    send(tool, ("LEFTMOUSE", "PRESS", 5, 5), ("MOUSEMOVE", "NOTHING", 9, 9), key("ESC"))
    send(tool, ("LEFTMOUSE", "PRESS", 30, 30), key("ESC"))
    assert tool.points == [(5.0, 5.0), None]
    assert send(tool, key("ESC")) == CANCELLED


def test_the_active_point_can_be_taken_away():
    tool = PointPlacing([(5.0, 5.0), (40.0, 20.0), (9.0, 30.0)], 1, SIZE)
    assert send(tool, key("X")) == RUNNING
    assert tool.points == [(5.0, 5.0), (9.0, 30.0)] and tool.sources == [0, 2]
    send(tool, key("X"), key("X"), key("X"))
    assert tool.points == [(5.0, 5.0)]


def test_tab_goes_through_the_points_and_one_beyond():
    tool = PointPlacing([(5.0, 5.0), (40.0, 20.0)], 0, SIZE)
    seen = []
    for _ in range(3):
        seen.append(tool.active)
        send(tool, key("TAB"))
    assert [*seen, tool.active] == [0, 1, 2, 0]


def test_a_view_without_sidebars_fits_as_it_is():
    assert fitted_between(12.5, 1000, 0, 0) == pytest.approx((12.5, 0.0))


def test_a_view_between_sidebars_is_as_wide_as_what_is_left_of_it():
    def scale(zoom):
        return (2**0.5 + zoom / 50) ** 2 / 4

    zoom, offset = fitted_between(12.5, 1000, 60, 440)
    assert scale(zoom) / scale(12.5) == pytest.approx(0.5)
    # Blender moves a camera's view by twice the offset, in widths of the view and its scale.
    assert 2 * offset * scale(zoom) * 1000 == pytest.approx((440 - 60) / 2)
