"""What the worker answers, asked of the fake world through one real process."""

import json

import numpy as np
import pytest
from plain_worker import LOAD, PLACES, Worker, boxes, camera, make_shot, render

from pe_runtime.contract.messages import Message
from pe_runtime.contract.shot import ObjectTrack, Start
from pe_runtime.images import write_png
from pe_runtime.worker.fake_world import FakeWorld
from pe_runtime.worker.world import box_mesh


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


def test_encode_puts_players_where_their_boxes_stand(worker):
    image = np.zeros((144, 256, 3), np.uint8)
    fields = {"camera": camera().as_dict(), "boxes": boxes()}
    state = worker.ask(Message("encode", fields, {"image": image})).fields["state"]
    for name, place in PLACES.items():
        np.testing.assert_allclose(state["objects"][name]["position"], place, atol=1e-9)


@pytest.mark.parametrize(
    ("box", "kind"),
    [
        ([10, 10, 10, 90], "ShotError"),
        ([10, 0, 30, 5], "CameraError"),
        (["a", 1, 2, 3], "ShotError"),
    ],
)
def test_a_box_without_a_place_on_the_ground_is_a_failure(worker, box, kind):
    fields = {"camera": camera().as_dict(), "boxes": {"player_1": box}}
    image = np.zeros((144, 256, 3), np.uint8)
    reply = worker.ask(Message("encode", fields, {"image": image}))
    assert reply.type == "failure"
    assert reply.fields["kind"] == kind
    assert worker.ask(LOAD).type == "ready"


def test_encode_refuses_what_is_no_picture(worker):
    fields = {"camera": camera().as_dict(), "boxes": {}}
    assert "image" in worker.ask(Message("encode", fields)).fields["message"]
    grey = {"image": np.zeros((144, 256), np.uint8)}
    assert "uint8" in worker.ask(Message("encode", fields, grey)).fields["message"]
    small = {"image": np.zeros((10, 20, 3), np.uint8)}
    assert "20x10" in worker.ask(Message("encode", fields, small)).fields["message"]


def test_a_rollout_moves_players_by_their_actions_relative_to_the_camera(worker, start):
    shot = make_shot(start)
    reply = worker.ask(Message("rollout", {"shot": shot.as_dict()}))
    assert (reply.type, reply.fields["fps"]) == ("state", 12.0)
    first, second = reply.buffers["player_1"], reply.buffers["player_2"]
    assert first.shape == (13, 3)
    # Five steps of 0.3 m in twelve frames.
    np.testing.assert_allclose(first[-1] - first[0], [-1.5, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(second[-1] - second[0], [0.0, -1.5, 0.0], atol=1e-6)


def test_render_sends_frames_in_order_with_their_passes_and_then_ready(worker, start):
    worker.send(render(make_shot(start, passes=("depth", "mask:player_1")), [3, 2]))
    replies = worker.until_terminal()
    assert [reply.type for reply in replies] == ["frame", "progress"] * 2 + ["ready"]
    assert [reply.fields["number"] for reply in replies[:4:2]] == [2, 3]
    assert replies[3].fields == {"stage": "render", "done": 2, "total": 2}
    rgb, depth, mask = (replies[0].buffers[n] for n in ("rgb", "depth", "mask:player_1"))
    assert (rgb.dtype, rgb.shape) == (np.uint8, (144, 256, 3))
    assert mask.max() == 1.0
    assert np.isfinite(depth[mask == 1.0]).all()
    assert np.isinf(depth).any()


def test_a_frame_alone_is_the_same_bytes_as_in_the_range(worker, start):
    shot = make_shot(start)
    worker.send(render(shot))
    whole = {r.fields["number"]: r for r in worker.until_terminal() if r.type == "frame"}
    worker.send(render(shot, [12]))
    alone = worker.until_terminal()[0]
    assert len(whole) == 13
    assert alone.buffers["rgb"].tobytes() == whole[12].buffers["rgb"].tobytes()
    assert not np.array_equal(whole[11].buffers["rgb"], whole[12].buffers["rgb"])


@pytest.mark.parametrize(
    ("fields", "named"),
    [
        ({"shot": None}, "shot"),
        ({"shot": {"version": 1}}, "model"),
        ({"frames": [99]}, "1 to 13"),
        ({"frames": [1.5]}, "frames"),
        ({"frames": "1-3"}, "frames"),
    ],
)
def test_a_malformed_render_is_a_failure_and_the_next_one_works(worker, start, fields, named):
    good = {"shot": make_shot(start).as_dict(), "frames": [1]}
    reply = worker.ask(Message("render", good | fields))
    assert reply.type == "failure"
    assert named in reply.fields["message"]
    worker.send(Message("render", good))
    assert worker.until_terminal()[-1].type == "ready"


def test_a_shot_of_another_model_than_the_loaded_one_is_refused(worker, start):
    reply = worker.ask(render(make_shot(start, model="fake"), [1]))
    assert "send load first" in reply.fields["message"]


def test_a_start_that_does_not_exist_is_a_failure_that_names_the_file(worker):
    reply = worker.ask(render(make_shot(Start(state="/nowhere/state.json")), [1]))
    assert "/nowhere/state.json" in reply.fields["message"]


def test_overrides_hide_and_move_players_in_the_fake_picture(start):
    hidden = ObjectTrack("player_1", visible=(False,) * 13)
    moved = ObjectTrack("player_2", locations=((0.0, 1.0, 0.0),) * 13)
    shot = make_shot(start, objects=(hidden, moved), passes=("mask:player_1", "mask:player_2"))
    picture = next(FakeWorld().render(shot, [1]))
    assert picture.buffers["mask:player_1"].max() == 0
    columns = np.nonzero(picture.buffers["mask:player_2"].any(axis=0))[0]
    assert abs(columns.mean() + 0.5 - 128) < 1.0


def test_a_fake_shot_starts_from_a_state_file(tmp_path):
    state = {n: {"position": [i, 0.0, 0.0]} for i, n in enumerate(["player_1", "player_2"])}
    (tmp_path / "s.json").write_text(json.dumps({"objects": state}))
    paths = FakeWorld().rollout(make_shot(Start(state=str(tmp_path / "s.json")), objects=()))
    np.testing.assert_array_equal(paths["player_2"], np.tile([1.0, 0, 0], (13, 1)))


def test_unknown_objects_and_actions_are_refused_by_the_fake_world(worker, start):
    for track, named in [
        (ObjectTrack("player_3"), "player_3"),
        (ObjectTrack("player_1", ((1, 6),)), "action 6"),
    ]:
        reply = worker.ask(render(make_shot(start, objects=(track,)), [1]))
        assert named in reply.fields["message"]


def test_a_proxy_mesh_is_a_closed_box_with_outward_faces(worker):
    reply = worker.ask(Message("proxy_mesh", {"object": "player_1"}))
    vertices, faces = reply.buffers["vertices"], reply.buffers["faces"]
    a, b, c = (vertices[faces[:, corner]].astype(float) for corner in range(3))
    # The divergence theorem: only a closed, outward surface has the box's volume.
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
    assert volume == pytest.approx(0.5 * 0.5 * 1.8, rel=1e-6)
    assert box_mesh((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))[0].dtype == np.float32
