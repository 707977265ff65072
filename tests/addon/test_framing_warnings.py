"""What is said of unusual cameras and boxes before anything is encoded, and which boxes can be."""

import dataclasses

import numpy as np
import pytest
from addon.stage import BOXES, HEIGHT, WIDTH, front_camera

from blender_addon.framing.box_limits import all_inside, inside
from blender_addon.framing.landmarks import focal_of, landmarks, misses
from blender_addon.framing.warnings import field_of_view, foot_of, on_ground, warnings_for
from pe_runtime.contract.camera import Camera, project
from pe_runtime.contract.envelope import Envelope
from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.model_facts import ModelFacts, Volume

SIZE = (WIDTH, HEIGHT)
KNOWN = Envelope(
    positions=((-5.0, -5.0), (5.0, 9.0)),
    camera_heights=(2.0, 3.0),
    camera_distances=(3.0, 12.0),
    camera_pitches=(-30.0, -10.0),
    fields_of_view=(40.0, 60.0),
    box_heights=(0.3, 0.8),
)
FACTS = ModelFacts("m", dict.fromkeys(BOXES, ()), 5.0, 256, 144, envelope=KNOWN)


def kinds(camera=None, boxes=BOXES, facts=FACTS):
    return [(each.kind, each.object) for each in warnings_for(facts, camera, boxes, SIZE)]


def facts_with(**changes):
    return dataclasses.replace(FACTS, envelope=dataclasses.replace(KNOWN, **changes))


def test_what_the_model_knows_is_not_warned_of():
    assert kinds(front_camera()) == []


def test_an_excess_that_would_be_said_as_nothing_is_no_warning():
    camera = front_camera()
    height = float(camera.world_from_camera[2, 3])
    assert kinds(camera, facts=facts_with(camera_heights=(0.0, height - 0.04))) == []
    assert kinds(camera, facts=facts_with(camera_heights=(0.0, height - 0.06))) != []
    feet = [foot_of(camera, box) for box in BOXES.values()]
    nearest = min(y for _, y in feet)
    assert kinds(camera, facts=facts_with(positions=((-5.0, nearest + 0.04), (5.0, 9.0)))) == []
    assert kinds(camera, facts=facts_with(positions=((-5.0, nearest + 0.06), (5.0, 9.0)))) != []


@pytest.mark.parametrize(
    ("changes", "kind", "text"),
    [
        ({"camera_heights": (3.0, 4.0)}, "camera height", "2.5 m above the ground, 0.5 m too lit"),
        (
            {"camera_pitches": (-10.0, 0.0)},
            "camera pitch",
            r"-16.3° from the horizon, 6.3° too lit",
        ),
        (
            {"fields_of_view": (10.0, 20.0)},
            "field of view",
            r"53.1° from side to side, 33.1° too m",
        ),
        ({"camera_distances": (20.0, 30.0)}, "camera distance", "m too little"),
    ],
)
def test_an_unusual_camera_is_said_with_how_much_it_differs(changes, kind, text):
    found = warnings_for(facts_with(**changes), front_camera(), BOXES, SIZE)
    assert [(each.kind, each.object, each.impossible) for each in found] == [(kind, "", False)]
    assert found[0].text.find(text.replace("\\", "")) >= 0


def test_a_place_outside_of_the_known_ground_names_the_player_and_the_distance():
    place = foot_of(front_camera(), BOXES["player_1"])
    low = (place[0] + 1.5, -50.0)
    (found,) = warnings_for(facts_with(positions=(low, (50.0, 50.0))), front_camera(), BOXES, SIZE)
    assert (found.kind, found.object) == ("position", "player_1")
    assert "1.5 m outside" in found.text


def test_a_small_box_is_said_as_a_share_of_the_picture():
    (found,) = warnings_for(facts_with(box_heights=(0.53, 0.9)), front_camera(), BOXES, SIZE)
    assert (found.kind, found.object) == ("box height", "player_2")
    assert "50% of the picture's height" in found.text and "53% to 90%" in found.text


def test_a_camera_that_has_passed_through_blender_is_not_outside_by_rounding():
    camera = front_camera()
    pose = camera.world_from_camera.copy()
    pose[2, 3] += 1e-6
    rounded = Camera(WIDTH, HEIGHT, camera.intrinsics, pose)
    assert kinds(rounded, facts=facts_with(camera_heights=(2.0, 2.5))) == []


def test_feet_above_the_horizon_are_impossible_and_others_are_judged_on():
    up = front_camera()
    pose = up.world_from_camera.copy()
    pose[:3, :3] = np.array([[1.0, 0.0, 0.0], [0.0, 0.28, 0.96], [0.0, -0.96, 0.28]])
    (first, second, *rest) = warnings_for(
        FACTS, Camera(WIDTH, HEIGHT, up.intrinsics, pose), BOXES, SIZE
    )
    assert first.kind == second.kind == "horizon" and first.impossible and second.impossible
    assert [each.kind for each in rest] == ["camera pitch"]


@pytest.mark.parametrize(
    ("box", "side"),
    [
        ((0.0, 5.0, 9.0, 30.0), "left"),
        ((5.0, 0.2, 9.0, 18.0), "upper"),
        ((50.0, 5.0, 64.0, 30.0), "right"),
        ((5.0, 15.0, 9.0, 36.0), "lower"),
    ],
)
def test_a_box_cut_by_the_border_is_said(box, side):
    (found,) = warnings_for(None, None, {"player_1": box}, SIZE)
    assert (found.kind, found.object, found.impossible) == ("border", "player_1", False)
    assert f"touches the {side} border" in found.text
    assert ("feet" in found.text) == (side == "lower")


def test_without_a_model_or_a_camera_only_the_picture_is_judged():
    assert kinds(None) == []
    assert kinds(front_camera(), facts=None) == []
    assert kinds(front_camera(), facts=dataclasses.replace(FACTS, envelope=None)) == []


def test_pixels_of_the_ground_come_back_to_their_place():
    camera = front_camera()
    for place in ((0.0, 0.0), (-2.5, 3.0), (1.0, -4.0)):
        pixel, _ = project(camera, np.array([[*place, 0.0]]))
        assert on_ground(camera, *pixel[0]) == pytest.approx(place)


def test_a_camera_below_the_ground_sees_no_ground():
    camera = front_camera()
    pose = camera.world_from_camera.copy()
    pose[2, 3] = -1.0
    assert on_ground(Camera(WIDTH, HEIGHT, camera.intrinsics, pose), 32, 30) is None


def test_fields_of_view_and_focal_lengths_are_inverse():
    focal = focal_of(np.radians(50.0), 640)
    matrix = np.array([[focal, 0, 320], [0, focal, 180], [0, 0, 1.0]])
    camera = Camera(640, 360, matrix, front_camera().world_from_camera)
    assert field_of_view(camera) == pytest.approx(50.0)


def test_boxes_beyond_the_picture_are_cut_with_a_note():
    assert inside("a", (2, 3, 9, 9), SIZE) == ((2, 3, 9, 9), "")
    box, note = inside("a", (-5, 3, 9, 99), SIZE)
    assert box == (0, 3, 9, 36) and "cut at the picture's border" in note
    boxes, notes = all_inside({"a": (2, 3, 9, 9), "b": (50, 3, 90, 9)}, SIZE)
    assert boxes["b"] == (50, 3, 64, 9) and len(notes) == 1


@pytest.mark.parametrize(
    ("box", "message"),
    [
        ((9, 3, 2, 9), "no area"),
        ((2, 3, 2.5, 9), "no area"),
        ((float("nan"), 3, 9, 9), "no area"),
        ((70, 3, 90, 9), "outside the picture of 64 x 36"),
        ((2, -9, 9, 0.5), "outside the picture"),
    ],
)
def test_boxes_that_hold_nothing_are_refused_in_words(box, message):
    with pytest.raises(ShotError, match=message):
        inside("player_1", box, SIZE)


COURT = dataclasses.replace(
    FACTS,
    volumes={
        "court": Volume((-6.0, -4.0, -0.02), (6.0, 8.0, 0.0)),
        "fence": Volume((-2.0, 0.0, 0.0), (2.0, 0.1, 3.0)),
        "banner": Volume((-2.0, 0.0, 0.0), (2.0, 0.1, 1.0)),
        "player_1": Volume((-1.0, -1.0, 0.0), (1.0, 1.0, 2.0)),
    },
)


def test_the_ground_names_its_corners_and_what_stands_on_it_once_it_is_known_where():
    assert set(landmarks(None)) == set()
    plain = landmarks(COURT)
    assert plain["court: far left"] == (-6.0, 8.0) and len(plain) == 4
    placed = landmarks(COURT, {"fence": (0.0, 9.0, 0.0), "banner": (0.0, 9.0, 2.0)})
    assert placed["fence: near right"] == (2.0, 9.0) and len(placed) == 8


def test_misses_are_distances_in_pixels():
    camera = front_camera()
    pixel, _ = project(camera, np.array([[1.0, 2.0, 0.0]]))
    u, v = pixel[0]
    found = misses(camera, [(u, v, 1.0, 2.0), (u + 3, v - 4, 1.0, 2.0), (u, v, 1.0, -99.0)])
    assert found[:2] == pytest.approx([0.0, 5.0]) and np.isnan(found[2])
