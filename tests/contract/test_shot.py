import json

import numpy as np
import pytest

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.shot import ObjectTrack, Shot, Start, StyleMix

INTRINSICS = np.array([[200.0, 0, 128], [0, 200, 72], [0, 0, 1]])


def camera(x=0.0, width=256):
    pose = np.eye(4)
    pose[0, 3] = x
    return Camera(width, 144, INTRINSICS, pose)


def shot(**changes):
    content = {
        "version": 1,
        "model": "duel",
        "start": Start("a.png", camera(), {"player_1": (1.0, 2.0, 3.0, 4.5)}),
        "fps": 24.0,
        "frame_start": 1,
        "frame_end": 3,
        "cameras": tuple(camera(x / 3) for x in range(3)),
        "objects": (
            ObjectTrack(
                "player_1",
                actions=((1, 2), (3, 0)),
                locations=((0.1, 0.2, 0.0),) * 3,
                visible=(True, False, True),
                styles=(StyleMix(2, None, "player_2", 0.25),),
                headings=(0.5, -3.0, 7.0),
            ),
        ),
        "passes": ("depth", "mask:player_1"),
    }
    return Shot(**(content | changes))


def document(**changes):
    return json.loads(shot().to_json()) | changes


def test_a_shot_comes_back_from_json_unchanged():
    original = shot()
    assert Shot.from_json(original.to_json()) == original


def test_a_start_from_a_state_file_comes_back_from_json_unchanged():
    original = shot(start=Start(state="state.json"))
    assert Shot.from_json(original.to_json()) == original


def test_optional_keys_may_be_missing():
    content = document()
    for key in ("objects", "quality", "passes"):
        del content[key]
    read = Shot.from_dict(content)
    assert (read.objects, read.quality, read.passes) == ((), "exact", ())


def test_equal_shots_have_equal_digests_and_other_shots_do_not():
    assert shot().digest() == Shot.from_json(shot().to_json()).digest()
    assert shot().digest() != shot(fps=25.0).digest()
    assert shot().digest() != shot(cameras=(camera(), camera(), camera(1e-9))).digest()


def test_a_shot_without_headings_is_the_document_it_was_before_there_were_any():
    plain = shot(objects=(ObjectTrack("player_1", ((1, 2),)),))
    assert "headings" not in plain.to_json()
    turned = shot(objects=(ObjectTrack("player_1", ((1, 2),), headings=(0.0,) * 3),))
    assert turned.digest() != plain.digest()


def test_the_digest_does_not_depend_on_the_order_of_keys():
    content = document()
    assert Shot.from_dict(dict(reversed(content.items()))).digest() == shot().digest()


@pytest.mark.parametrize(
    ("frame", "action"), [(-5, 2), (1, 2), (2, 2), (3, 0), (99, 0)], ids=lambda value: str(value)
)
def test_an_action_is_held_until_the_next_key(frame, action):
    assert shot().action_at("player_1", frame) == action


def test_an_object_without_keys_has_no_action():
    assert shot(objects=(ObjectTrack("player_1"),)).action_at("player_1", 1) is None
    assert shot().action_at("player_2", 1) is None


def test_each_frame_has_its_camera_and_other_frames_are_refused():
    assert shot().camera_at(3) == camera(2 / 3)
    with pytest.raises(ShotError, match="1 to 3"):
        shot().camera_at(4)


def test_style_mixes_hold_until_the_next_styled_frame():
    early, late, also_late = (StyleMix(f, None, n, 0.5) for f, n in [(2, "a"), (5, "b"), (5, "c")])
    track = ObjectTrack("player_1", styles=(early, late, also_late))
    assert track.styles_at(1) == ()
    assert track.styles_at(4) == (early,)
    assert track.styles_at(6) == (late, also_late)


def test_masks_and_depth_are_read_from_the_passes():
    assert shot().mask_names == ("player_1",)
    assert shot().wants_depth
    assert not shot(passes=()).wants_depth


def test_an_unknown_key_is_refused_with_the_nearest_known_one():
    content = document(qualty="draft")
    with pytest.raises(ShotError, match="qualty.*did you mean 'quality'"):
        Shot.from_dict(content)


def test_an_unknown_key_inside_an_object_is_refused_with_its_place():
    content = document()
    content["objects"][0]["action"] = []
    with pytest.raises(ShotError, match=r"objects\[0\].*did you mean 'actions'"):
        Shot.from_dict(content)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"version": 2}, "version"),
        ({"version": "1"}, "version"),
        ({"model": ""}, "model"),
        ({"fps": 0}, "fps"),
        ({"fps": -24.0}, "fps"),
        ({"fps": float("nan")}, "fps"),
        ({"fps": True}, "fps"),
        ({"frame_end": 0}, "frame_end"),
        ({"frame_end": 4}, "cameras"),
        ({"frame_start": 1.0}, "frame_start"),
        ({"quality": "exakt"}, "did you mean 'exact'"),
        ({"passes": ["dept"]}, "did you mean 'depth'"),
        ({"passes": ["mask:"]}, "passes"),
        ({"passes": ["depth", "depth"]}, "each pass once"),
        ({"cameras": [{"width": 2}] * 3}, r"cameras\[0\]"),
        ({"start": {}}, "start"),
        ({"start": {"state": "a.json", "image": "a.png"}}, "start"),
        ({"start": []}, "start"),
        ({"objects": [{"name": "a"}, {"name": "a"}]}, "each object once"),
        ({"objects": [{"name": ""}]}, "name"),
        ({"objects": [{"actions": []}]}, "'name'"),
        ({"objects": [{"name": "a", "actions": [[1, 0], [1, 2]]}]}, "increasing"),
        ({"objects": [{"name": "a", "actions": [[1, -1]]}]}, "actions"),
        ({"objects": [{"name": "a", "actions": [[1, 0.5]]}]}, "actions"),
        ({"objects": [{"name": "a", "actions": [[1]]}]}, "actions"),
        ({"objects": [{"name": "a", "visible": [True]}]}, "visible"),
        ({"objects": [{"name": "a", "visible": [1, 1, 1]}]}, "visible"),
        ({"objects": [{"name": "a", "locations": [[0, 0, 0]] * 2}]}, "locations"),
        ({"objects": [{"name": "a", "locations": [[0, 0]] * 3}]}, "locations"),
        ({"objects": [{"name": "a", "locations": [[0, 0, float("inf")]] * 3}]}, "locations"),
        ({"objects": [{"name": "a", "headings": [0.0, 1.0]}]}, "headings"),
        ({"objects": [{"name": "a", "headings": [0.0, 1.0, float("nan")]}]}, "headings"),
        ({"objects": [{"name": "a", "headings": 1.0}]}, "headings"),
        ({"objects": [{"name": "a", "styles": [{"frame": 1}]}]}, "styles"),
    ],
    ids=str,
)
def test_a_malformed_value_is_refused_by_the_name_of_its_key(change, named):
    with pytest.raises(ShotError, match=named):
        Shot.from_dict(document(**change), "job.json")


def test_a_weight_outside_its_range_and_weights_above_one_are_refused():
    with pytest.raises(ShotError, match="0 to 1"):
        StyleMix(1, None, "a", 1.5)
    with pytest.raises(ShotError, match="at most 1"):
        ObjectTrack("a", styles=(StyleMix(1, None, "b", 0.7), StyleMix(1, None, "c", 0.7)))


def test_cameras_of_different_sizes_are_refused():
    with pytest.raises(ShotError, match="one picture size"):
        shot(cameras=(camera(), camera(), camera(width=128)))


def test_a_missing_key_is_refused_by_name():
    content = document()
    del content["fps"]
    with pytest.raises(ShotError, match="'fps'"):
        Shot.from_dict(content)


@pytest.mark.parametrize("text", ["", "{", "[1]", "null", '"shot"'])
def test_a_document_that_is_not_a_shot_is_refused_with_its_name(text):
    with pytest.raises(ShotError, match="job.json"):
        Shot.from_json(text, "job.json")
