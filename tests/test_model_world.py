"""A real, tiny environment behind the wire and in shots: exact, repeatable, cached."""

import dataclasses
import io

import numpy as np
import pytest
import tiny_model

import pe_runtime
from pe_runtime.contract.errors import ConfigError
from pe_runtime.contract.messages import (
    PROTOCOL,
    Message,
    read_message,
    write_message,
)
from pe_runtime.contract.model_facts import ModelFacts
from pe_runtime.contract.shot import ObjectTrack, Shot
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.images import read_image, to_uint8
from pe_runtime.shots import render_shot
from pe_runtime.shots.clips import start_from_clip
from pe_runtime.worker.model_world import REMEMBERED_ROLLOUTS, ModelWorld
from pe_runtime.worker.serving import Inbox, serve


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return tiny_model.write_model(tmp_path_factory.mktemp("model") / "tiny.safetensors")


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    return tiny_model.write_clip(tmp_path_factory.mktemp("clip"))


@pytest.fixture
def shot(model, clip):
    return Shot(
        version=1,
        model=model,
        start=start_from_clip(clip),
        fps=12.0,
        frame_start=1,
        frame_end=13,
        cameras=tuple(tiny_model.camera(0.05 * index) for index in range(13)),
        objects=(ObjectTrack("player_1", ((1, 1),)), ObjectTrack("player_2", ((1, 2),))),
        passes=("depth", "mask:player_1"),
    )


@pytest.fixture
def world(model):
    each = ModelWorld("cpu")
    each.load(model)
    return each


def converse(*requests):
    """All replies of a worker with a real environment to some requests."""
    source, sink = io.BytesIO(), io.BytesIO()
    hello = Message("hello", {"protocol": PROTOCOL, "version": pe_runtime.__version__})
    for request in (hello, *requests):
        write_message(source, request)
    source.seek(0)
    assert serve(lambda: ModelWorld("cpu"), Inbox(source), sink) == 0
    sink.seek(0)
    return list(iter(lambda: read_message(sink), None))[1:]


def test_load_encode_rollout_and_render_answer_over_the_wire(model, shot):
    picture = to_uint8(read_image(shot.start.image))
    boxes = {name: list(box) for name, box in shot.start.boxes.items()}
    replies = converse(
        Message("load", {"model": model}),
        Message(
            "encode",
            {"camera": shot.start.camera.as_dict(), "boxes": boxes},
            {"image": picture},
        ),
        Message("rollout", {"shot": shot.as_dict()}),
        Message("render", {"shot": shot.as_dict(), "frames": [2]}),
        Message("proxy_mesh", {"object": "player_1"}),
    )
    types = ["ready", "state", "state", "frame", "progress", "ready", "state"]
    assert [reply.type for reply in replies] == types
    facts = ModelFacts.from_fields(replies[0].fields)
    assert facts.action_names["player_2"] == tiny_model.ACTIONS
    state = replies[1].fields["state"]["objects"]
    first = replies[2].buffers["player_1"]
    assert first.shape == (13, 3)
    np.testing.assert_allclose(first[0], state["player_1"]["position"], atol=1e-6)
    assert set(replies[3].buffers) == {"rgb", "depth", "mask:player_1"}
    assert replies[6].buffers["vertices"].shape == (8, 3)


def test_an_unknown_model_names_the_known_ones_over_the_wire():
    (reply,) = converse(Message("load", {"model": "dual"}))
    assert reply.fields["kind"] == "CheckpointError"
    assert "built in" in reply.fields["message"]


def test_a_box_without_area_is_a_camera_error_over_the_wire(model, shot):
    fields = {"camera": shot.start.camera.as_dict(), "boxes": {"player_1": [4, 4, 4, 9]}}
    image = {"image": to_uint8(read_image(shot.start.image))}
    replies = converse(Message("load", {"model": model}), Message("encode", fields, image))
    assert replies[1].fields["kind"] == "CameraError"


def test_frame_12_of_a_real_model_alone_is_byte_for_byte_frame_12_of_the_range(
    model, shot, tmp_path
):
    render_shot(PlayableEnvironment.load(model, "cpu"), shot, tmp_path / "all")
    render_shot(PlayableEnvironment.load(model, "cpu"), shot, tmp_path / "one", frames=[12])
    for name in ("0012.png", "0012.exr"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "all" / name).read_bytes()


def test_the_worker_sends_the_bytes_that_the_command_line_writes(model, shot, world, tmp_path):
    render_shot(PlayableEnvironment.load(model, "cpu"), shot, tmp_path, frames=[5])
    (picture,) = world.render(shot, [5])
    np.testing.assert_array_equal(
        picture.buffers["rgb"], to_uint8(read_image(tmp_path / "0005.png"))
    )


def test_rollouts_are_remembered_for_the_latest_shots_only(world, shot, monkeypatch):
    encoded = []
    encode = PlayableEnvironment.encode
    monkeypatch.setattr(
        PlayableEnvironment, "encode", lambda *each: encoded.append(1) or encode(*each)
    )
    world.rollout(shot)
    list(world.render(dataclasses.replace(shot, quality="draft"), [1, 2]))
    assert len(encoded) == 1
    for index in range(REMEMBERED_ROLLOUTS):
        world.rollout(dataclasses.replace(shot, fps=12.5 + index))
    world.rollout(shot)
    assert len(encoded) == REMEMBERED_ROLLOUTS + 2


def test_a_model_without_playable_objects_renders(clip, tmp_path):
    model = tiny_model.write_model(tmp_path / "empty.safetensors", players=())
    environment = PlayableEnvironment.load(model, "cpu")
    start = dataclasses.replace(start_from_clip(clip), boxes={})
    cameras = (tiny_model.camera(),) * 2
    shot = Shot(1, model, start, 5.0, 1, 2, cameras)
    assert render_shot(environment, shot, tmp_path / "out").written == (1, 2)


def test_a_player_behind_the_camera_or_out_of_view_costs_no_error(world, shot):
    for place in ((0.0, -50.0, 0.0), (500.0, 0.0, 0.0)):
        track = ObjectTrack("player_1", locations=(place,) * 13)
        (picture,) = world.render(dataclasses.replace(shot, objects=(track,)), [1])
        assert picture.buffers["mask:player_1"].max() == 0.0


def test_an_unknown_object_has_no_proxy_mesh(world):
    with pytest.raises(ConfigError, match="player_9"):
        world.proxy_mesh("player_9")
