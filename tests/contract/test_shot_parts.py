"""Held poses, regions, layers and backgrounds of a shot, and the model's envelope."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.envelope import Envelope
from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.shot import ObjectTrack, PoseKey, Shot, Start

INTRINSICS = np.array([[200.0, 0, 128], [0, 200, 72], [0, 0, 1]])
CAMERA = Camera(256, 144, INTRINSICS, np.eye(4))
HELD = ObjectTrack("player_1", poses=(PoseKey(2, 40), PoseKey(3, None)))


def shot(**changes):
    content = {"version": 1, "model": "duel", "start": Start("a.png", CAMERA), "fps": 24.0}
    content |= {"frame_start": 1, "frame_end": 3, "cameras": (CAMERA,) * 3, "objects": (HELD,)}
    return Shot(**(content | changes))


def document(track):
    content = json.loads(shot().to_json())
    content["objects"][0] |= track
    return content


def test_poses_region_and_new_passes_come_back_from_json_unchanged():
    passes = ("layer:player_1", "background", "layer:a:b")
    original = shot(region=(3, 4, 250, 1), passes=passes)
    assert Shot.from_json(original.to_json()) == original
    assert original.layer_names == ("player_1", "a:b") and original.wants_background
    assert original.mask_names == () and not original.wants_depth


def test_a_shot_that_uses_none_of_it_is_the_document_it_was_before():
    plain = shot(objects=(ObjectTrack("player_1"),))
    assert "region" not in plain.as_dict() and "poses" not in plain.as_dict()["objects"][0]
    pinned = "94bd061756"
    assert plain.digest()[:10] == pinned


def test_a_region_and_a_pose_make_it_another_shot():
    digests = {shot().digest(), shot(region=(0, 0, 256, 144)).digest(), shot(objects=()).digest()}
    assert len(digests) == 3


def test_what_is_drawn_has_the_size_of_the_region_or_of_the_cameras():
    assert shot().size == (256, 144)
    assert shot(region=(1, 2, 30, 40)).size == (30, 40)


@pytest.mark.parametrize(("frame", "held"), [(1, None), (2, 40), (3, None), (99, None)])
def test_a_pose_is_held_until_it_is_freed(frame, held):
    assert HELD.pose_at(frame) == held


@pytest.mark.parametrize(
    ("region", "named"),
    [
        ((0, 0, 0, 5), "at least one pixel"),
        ((0, 0, 5, -1), "at least one pixel"),
        ((-1, 0, 5, 5), "256x144"),
        ((250, 0, 7, 5), "256x144"),
        ((0, 140, 5, 5), "256x144"),
    ],
)
def test_an_empty_region_or_one_outside_of_the_picture_is_refused(region, named):
    with pytest.raises(ShotError, match=f"region.*{named}"):
        shot(region=region)


@pytest.mark.parametrize("region", [[0, 0, 5], [0, 0, 5.0, 5], "all", [True, 0, 5, 5]])
def test_a_region_that_is_not_four_whole_numbers_is_refused(region):
    with pytest.raises(ShotError, match="region"):
        Shot.from_dict(json.loads(shot().to_json()) | {"region": region})


@pytest.mark.parametrize(
    "poses", [[[1]], [[1, 2, 3]], [[1, "a"]], [["a", 1]], "x", [[2, 1], [2, 3]]]
)
def test_malformed_pose_keys_are_refused_by_name(poses):
    with pytest.raises(ShotError, match="poses"):
        Shot.from_dict(document({"poses": poses}))


@pytest.mark.parametrize("name", ["layer:", "backgrounds", "layer", "Background"])
def test_a_pass_that_is_almost_one_is_refused(name):
    with pytest.raises(ShotError, match="passes.*'layer:<object>'"):
        shot(passes=(name,))


ENVELOPE = Envelope(
    ((-3.0, -2.0), (3.0, 2.5)), (1.0, 3.0), (6.0, 11.0), (-20.0, -4.0), (47.0, 53.0), (0.2, 0.7)
)


def test_an_envelope_comes_back_from_json_unchanged():
    assert Envelope.from_dict(json.loads(json.dumps(ENVELOPE.as_dict()))) == ENVELOPE


@pytest.mark.parametrize(
    "wrong",
    [
        {"camera_heights": (2.0, 1.0)},
        {"box_heights": (0.0, float("nan"))},
        {"positions": ((0.0, 5.0), (1.0, 4.0))},
    ],
    ids=str,
)
def test_an_envelope_has_finite_ranges_that_end_after_they_begin(wrong):
    with pytest.raises(ValueError, match=f"envelope {next(iter(wrong))}"):
        replace(ENVELOPE, **wrong)
