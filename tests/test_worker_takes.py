"""Takes: parts of a prepared shot, filmed in their own way, over the prediction of the whole."""

import dataclasses
import os

import numpy as np
import pytest
import tiny_model
from plain_worker import LOAD, Worker, boxes, camera, make_shot, render

from pe_runtime.contract.messages import Message
from pe_runtime.contract.shot import ObjectTrack, Shot, Start
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.images import write_png
from pe_runtime.shots.clips import start_from_clip
from pe_runtime.worker.model_world import ModelWorld

FRAMES = 13


def take_of(whole, frame, **changes):
    """One frame of a shot without its action keys."""
    tracks = tuple(dataclasses.replace(track, actions=()) for track in whole.objects)
    fields = {"cameras": (whole.camera_at(frame),), "objects": tracks}
    return dataclasses.replace(whole, frame_start=frame, frame_end=frame, **(fields | changes))


def one_at(whole, frame, **changes):
    """The whole shot with changes at one frame: what a take of it has to look like."""
    cameras, tracks = list(whole.cameras), []
    index = frame - whole.frame_start
    cameras[index] = changes.pop("camera", cameras[index])
    for track in whole.objects:
        own = changes.get(track.name, {})
        spread = {key: (value,) * FRAMES for key, value in own.items()}
        tracks.append(dataclasses.replace(track, **spread))
    return dataclasses.replace(whole, cameras=tuple(cameras), objects=tuple(tracks))


def prepare(whole):
    return Message("prepare", {"shot": whole.as_dict()})


def film(take):
    message = render(take, list(take.frames))
    return Message("render", message.fields | {"take": True})


@pytest.fixture(scope="module")
def worker():
    each = Worker("--fake")
    each.ready()
    yield each
    each.process.kill()
    each.end()


@pytest.fixture
def whole(tmp_path):
    write_png(tmp_path / "start.png", np.full((144, 256, 3), 90, np.uint8))
    return make_shot(Start(str(tmp_path / "start.png"), camera(), boxes()))


def test_a_take_shows_the_frame_of_the_whole_shot(worker, whole):
    assert worker.ask(prepare(whole)).type == "ready"
    worker.send(render(whole, [12]))
    expected = worker.until_terminal()[0]
    worker.send(film(take_of(whole, 12)))
    frame, progress, ready = worker.until_terminal()
    assert frame.buffers["rgb"].tobytes() == expected.buffers["rgb"].tobytes()
    assert (frame.fields["number"], progress.fields["total"], ready.type) == (12, 1, "ready")
    assert frame.fields["seconds"] > 0
    alone = worker.ask(render(take_of(whole, 12), [12]))
    assert alone.buffers["rgb"].tobytes() != expected.buffers["rgb"].tobytes()
    assert worker.until_terminal()[-1].type == "ready"


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"frame_start": 14, "frame_end": 14}, "frames of 1 to 13"),
        ({"objects": (ObjectTrack("player_3"),)}, "player_3"),
        ({"model": "fake"}, "send load first"),
    ],
)
def test_what_is_no_part_of_the_prepared_shot_is_refused(worker, whole, changes, named):
    worker.ask(prepare(whole))
    reply = worker.ask(film(dataclasses.replace(take_of(whole, 2), **changes)))
    assert reply.type == "failure" and named in reply.fields["message"]


def test_a_take_needs_a_shot_that_was_prepared_for_the_loaded_model(worker, whole):
    worker.ask(prepare(whole))
    assert worker.ask(LOAD).type == "ready"
    assert "send prepare first" in worker.ask(film(take_of(whole, 2))).fields["message"]
    gone = dataclasses.replace(whole, start=Start(state="/nowhere/state.json"))
    worker.ask(prepare(whole))
    assert "/nowhere/state.json" in worker.ask(prepare(gone)).fields["message"]
    assert "send prepare first" in worker.ask(film(take_of(whole, 2))).fields["message"]


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return tiny_model.write_model(tmp_path_factory.mktemp("model") / "tiny.safetensors")


@pytest.fixture
def real(model, tmp_path):
    return Shot(
        version=1,
        model=model,
        start=start_from_clip(tiny_model.write_clip(tmp_path)),
        fps=12.0,
        frame_start=1,
        frame_end=FRAMES,
        cameras=tuple(tiny_model.camera(0.05 * index) for index in range(FRAMES)),
        objects=(ObjectTrack("player_1", ((1, 1),)), ObjectTrack("player_2", ((1, 2),))),
        passes=("depth", "mask:player_1"),
    )


def world_of(model):
    world = ModelWorld("cpu")
    world.load(model)
    return world


def same_bytes(a, b):
    return list(a.buffers) == list(b.buffers) and all(
        a.buffers[name].tobytes() == b.buffers[name].tobytes() for name in a.buffers
    )


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"camera": tiny_model.camera(0.4)},
        {"player_1": {"locations": (0.3, -0.2, 0.0)}, "player_2": {"headings": 0.8}},
        {"player_2": {"visible": False}},
    ],
    ids=["as baked", "seen from elsewhere", "moved and turned", "hidden"],
)
def test_a_take_of_a_real_model_is_byte_for_byte_the_frame_of_a_shot_changed_there(
    model, real, changes
):
    changed = one_at(real, 9, **changes)
    (expected,) = world_of(model).render(changed, [9])
    tracks = tuple(
        ObjectTrack(
            track.name,
            **{
                key: None if getattr(track, key) is None else getattr(track, key)[8:9]
                for key in ("locations", "visible", "headings")
            },
        )
        for track in changed.objects
    )
    take = take_of(real, 9, cameras=(changed.camera_at(9),), objects=tracks)
    (drawn,) = world_of(model).render(take, [9], real)
    assert set(drawn.buffers) == {"rgb", "depth", "mask:player_1"}
    assert same_bytes(drawn, expected)


def test_the_frames_of_a_range_predict_once(model, real, monkeypatch):
    world, steps, step = world_of(model), [], PlayableEnvironment.step
    monkeypatch.setattr(PlayableEnvironment, "step", lambda *given: steps.append(1) or step(*given))
    for frame in real.frames:
        moved = take_of(real, frame, cameras=(tiny_model.camera(0.3 + frame),))
        assert [each.number for each in world.render(moved, [frame], real)] == [frame]
    assert len(steps) == 5


def test_a_start_picture_that_was_replaced_is_noticed_though_the_shot_is_prepared(model, real):
    world, take = world_of(model), take_of(real, 2)
    (before,) = world.render(take, [2], real)
    noise = np.random.default_rng(3).integers(0, 256, (16, 32, 3), dtype=np.uint8)
    write_png(real.start.image, noise)
    os.utime(real.start.image, ns=(1, 1))
    (after,) = world.render(take, [2], real)
    (fresh,) = world_of(model).render(take, [2], real)
    assert same_bytes(after, fresh) and not same_bytes(after, before)


def test_a_model_that_is_loaded_anew_draws_no_prediction_of_the_old_one(model, real):
    world, take = world_of(model), take_of(real, 2)
    (before,) = world.render(take, [2], real)
    old = world._environment
    world.load(model)
    assert world._environment is not old and world._latest is None
    (after,) = world.render(take, [2], real)
    assert same_bytes(after, before)
