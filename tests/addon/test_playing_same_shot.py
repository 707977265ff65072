"""From which frame on two shots lead to other paths."""

import dataclasses

import numpy as np
import pytest
from addon.stage import front_camera, shot_of

from blender_addon.playing.same_shot import first_difference
from pe_runtime.contract.shot import ObjectTrack


@pytest.fixture
def shot(picture):
    return shot_of(picture, frames=8)


def moved(shot, frame):
    pose = front_camera().world_from_camera.copy()
    pose[0, 3] += 0.01
    cameras = list(shot.cameras)
    cameras[frame - 1] = dataclasses.replace(front_camera(), world_from_camera=pose)
    return dataclasses.replace(shot, cameras=tuple(cameras))


def acting(shot, *keys):
    tracks = (ObjectTrack("player_1", keys), *shot.objects[1:])
    return dataclasses.replace(shot, objects=tracks)


def test_the_same_shot_differs_nowhere_whatever_pictures_it_asks_for(shot):
    other = dataclasses.replace(shot, passes=(), quality="draft")
    assert first_difference(shot, other) is None


def test_other_cameras_and_actions_differ_from_their_frame_on(shot):
    assert first_difference(shot, moved(shot, 5)) == 5
    assert first_difference(shot, acting(shot, (1, 1), (4, 2))) == 4
    assert first_difference(acting(shot, (1, 1), (4, 2)), acting(shot, (1, 1), (6, 2))) == 4


def test_a_key_that_repeats_what_is_done_changes_nothing(shot):
    assert first_difference(shot, acting(shot, (1, 1), (4, 1))) is None


def test_a_shot_that_ends_elsewhere_differs_beyond_the_shorter_one(shot):
    longer = dataclasses.replace(shot, frame_end=10, cameras=(front_camera(),) * 10)
    assert first_difference(shot, longer) == 9
    assert first_difference(longer, shot) == 9


@pytest.mark.parametrize(
    "changes",
    [
        {"fps": 12.0},
        {"model": "turning"},
        {"objects": ()},
        {"frame_start": 2, "cameras": (front_camera(),) * 7},
    ],
    ids=["pace", "model", "objects", "start"],
)
def test_what_decides_about_all_frames_differs_from_the_first_on(shot, changes):
    other = dataclasses.replace(shot, **changes)
    assert first_difference(shot, other) == other.frame_start


def test_rounding_is_no_difference(shot):
    pose = front_camera().world_from_camera + 1e-9 * np.ones((4, 4))
    pose[3] = 0.0, 0.0, 0.0, 1.0
    camera = dataclasses.replace(front_camera(), world_from_camera=pose)
    assert first_difference(shot, dataclasses.replace(shot, cameras=(camera,) * 8)) is None
