"""Cameras, boxes, actions, digests, regions and layers, asked of the fake world by wire."""

import dataclasses

import numpy as np
import pytest
from plain_worker import PLACES, Worker, boxes, camera, make_shot, render

from pe_runtime.contract.camera import Camera, project
from pe_runtime.contract.messages import Message
from pe_runtime.contract.shot import ObjectTrack, PoseKey, Start, StyleMix
from pe_runtime.images import write_png
from pe_runtime.worker.fake_models import ACTIONS, STEP_LENGTH, fake_facts


@pytest.fixture
def start(tmp_path):
    image = tmp_path / "start.png"
    write_png(image, np.full((144, 256, 3), 90, np.uint8))
    return Start(str(image), camera(), boxes())


@pytest.fixture(scope="module")
def worker():
    each = Worker("--fake")
    each.ready()
    yield each
    each.process.kill()
    each.end()


def frame_of(worker, shot, number=2):
    worker.send(render(shot, [number]))
    replies = worker.until_terminal()
    assert replies[-1].type == "ready", replies[-1].fields
    return replies[0].buffers


def moved_states(worker, actions):
    """States that the fake model's own movements lead through, with their cameras."""
    state = {"objects": {name: {"position": list(place)} for name, place in PLACES.items()}}
    states, facts = [state], fake_facts("duel")
    for action in actions:
        right, ahead = facts.movements["player_1"][action]
        before = states[-1]["objects"]
        places = {
            n: [each["position"][0] + right, each["position"][1] + ahead, 0.0]
            for n, each in before.items()
        }
        states.append({"objects": {n: {"position": place} for n, place in places.items()}})
    return states, [camera().as_dict()] * len(states)


def test_the_actions_that_led_from_state_to_state_are_found_again(worker):
    taken = [ACTIONS.index(name) for name in ("left", "forward", "idle", "back", "right")]
    states, cameras = moved_states(worker, taken)
    reply = worker.ask(Message("infer_actions", {"states": states, "cameras": cameras}))
    assert reply.fields["actions"] == {"player_1": taken, "player_2": taken}


def test_actions_need_one_camera_per_state(worker):
    states, cameras = moved_states(worker, [1])
    reply = worker.ask(Message("infer_actions", {"states": states, "cameras": cameras[:1]}))
    assert "2 states and 1 cameras" in reply.fields["message"]


def test_a_camera_is_matched_from_points_of_the_ground(worker):
    ground = np.array([[-2.0, -1.0, 0], [2, -1, 0], [2, 2, 0], [-2, 2, 0], [0.5, 0.5, 0]])
    pixels, _ = project(camera(), ground)
    points = np.hstack([pixels, ground[:, :2]]).tolist()
    asked = {"width": 256, "height": 144, "points": points, "focal": None}
    reply = worker.ask(Message("match_camera", asked))
    found = Camera.from_dict(reply.fields["camera"])
    np.testing.assert_allclose(found.world_from_camera, camera().world_from_camera, atol=1e-3)
    assert reply.fields["residual"] <= reply.fields["worst"] < 0.01
    failed = worker.ask(Message("match_camera", asked | {"points": points[:2]}))
    assert failed.fields["kind"] == "CameraError" and "found 2" in failed.fields["message"]
    wrong = worker.ask(Message("match_camera", asked | {"focal": "long"}))
    assert wrong.type == "failure" and "focal" in wrong.fields["message"]


def test_players_are_detected_at_shares_of_the_picture(worker):
    found = {}
    for size in ((144, 256), (288, 512)):
        image = {"image": np.zeros((*size, 3), np.uint8)}
        reply = worker.ask(Message("detect", {"names": ["player_2", "player_1"]}, image))
        assert set(reply.fields["scores"]) == {"player_1", "player_2"}
        found[size] = reply.fields["boxes"]
    small, large = found.values()
    assert large["player_1"] == pytest.approx([2 * edge for edge in small["player_1"]])
    assert small["player_1"][2] < small["player_2"][0]
    unknown = {"names": ["player_3"]}
    assert "player_3" in worker.ask(Message("detect", unknown, image)).fields["message"]
    assert "image" in worker.ask(Message("detect", {"names": []})).fields["message"]


def test_equal_digests_are_equal_pictures_and_what_changes_them_changes_those(worker, start):
    shot = make_shot(start)
    asked = worker.ask(Message("digests", {"shot": shot.as_dict()}))
    digests = asked.fields["digests"]
    assert list(digests) == [str(frame) for frame in shot.frames]
    again = worker.ask(Message("digests", {"shot": shot.as_dict(), "take": False}))
    assert again.fields["digests"] == digests
    seen = (True,) * 6 + (False,) + (True,) * 6
    tracks = (dataclasses.replace(shot.objects[0], visible=seen), shot.objects[1])
    changed = worker.ask(
        Message("digests", {"shot": dataclasses.replace(shot, objects=tracks).as_dict()})
    ).fields["digests"]
    assert [frame for frame in digests if changed[frame] != digests[frame]] == ["7"]


def test_a_region_is_cut_out_of_every_buffer(worker, start):
    passes = ("depth", "mask:player_1", "layer:player_1", "background")
    whole = frame_of(worker, make_shot(start, passes=passes))
    part = frame_of(worker, make_shot(start, passes=passes, region=(60, 20, 100, 90)))
    assert set(part) == {"rgb", *passes}
    for name, buffer in part.items():
        np.testing.assert_array_equal(buffer, whole[name][20:110, 60:160])


def test_the_layer_of_a_player_lies_where_its_mask_does_over_the_background(worker, start):
    hidden = ObjectTrack("player_2", visible=(False,) * 13)
    passes = ("mask:player_1", "layer:player_1", "background")
    frame = frame_of(worker, make_shot(start, passes=passes, objects=(hidden,)))
    layer, background = frame["layer:player_1"], frame["background"]
    assert (layer.dtype, layer.shape) == (np.uint8, (144, 256, 4))
    np.testing.assert_array_equal(layer[..., 3] > 0, frame["mask:player_1"] > 0)
    composed = np.where(layer[..., 3:] > 0, layer[..., :3], background)
    np.testing.assert_array_equal(composed, frame["rgb"])


def test_styles_and_held_poses_show_in_the_fake_picture(worker, start):
    plain = frame_of(worker, make_shot(start))["rgb"]
    for track in (
        ObjectTrack("player_1", styles=(StyleMix(1, None, "player_2", 0.5),)),
        ObjectTrack("player_1", poses=(PoseKey(1, 9),)),
    ):
        assert (frame_of(worker, make_shot(start, objects=(track,)))["rgb"] != plain).any()
    freed = ObjectTrack("player_1", ((1, 1),), poses=(PoseKey(1, 9), PoseKey(2, None)))
    objects = (freed, make_shot(start).objects[1])
    np.testing.assert_array_equal(frame_of(worker, make_shot(start, objects=objects))["rgb"], plain)
    late = ObjectTrack("player_1", poses=(PoseKey(1, 99),))
    reply = worker.ask(render(make_shot(start, objects=(late,)), [2]))
    assert "frame 99" in reply.fields["message"] and "1 to 13" in reply.fields["message"]


def test_the_fake_models_tell_what_they_know(worker):
    facts = fake_facts("duel")
    assert facts.movements["player_1"][ACTIONS.index("left")] == (-STEP_LENGTH, 0.0)
    low, high = facts.envelope.camera_heights
    assert low < facts.usual_camera.world_from_camera[2, 3] < high
    assert facts.detects and facts.device and len(facts.digest) == 64
    assert fake_facts("still").envelope is None and fake_facts("still").movements["player_1"] == ()
