"""Takes: parts of a prepared shot, filmed in their own way, over the prediction of the whole."""

import dataclasses
import json
import os

import numpy as np
import pytest
import tiny_model
from plain_worker import LOAD, Worker, boxes, camera, make_shot, render

from pe_runtime.contract.errors import ConfigError, ShotError
from pe_runtime.contract.messages import Message
from pe_runtime.contract.shot import ObjectTrack, PoseKey, Shot, Start, StyleMix
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.images import write_png
from pe_runtime.shots.clips import start_from_clip
from pe_runtime.worker import model_world
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


def lender_of(real, path):
    """A state file in which the players look otherwise."""
    state = world_of(real.model).encode(
        np.full((16, 32, 3), 200, np.uint8), tiny_model.camera(), tiny_model.boxes()
    )
    path.write_text(json.dumps(state))
    return str(path)


def test_a_take_has_styles_and_poses_of_its_own(model, real, tmp_path):
    file = lender_of(real, tmp_path / "other.json")
    styled = dataclasses.replace(
        real.objects[0],
        styles=(StyleMix(1, file, "player_2", 0.5), StyleMix(9, None, "player_2", 0.75)),
        poses=(PoseKey(2, 12), PoseKey(10, None)),
    )
    changed = dataclasses.replace(real, objects=(styled, real.objects[1]))
    for frame in (4, 9):
        (expected,) = world_of(model).render(changed, [frame])
        take = take_of(real, frame, objects=(dataclasses.replace(styled, actions=()),))
        world = world_of(model)
        (drawn,) = world.render(take, [frame], real)
        assert same_bytes(drawn, expected)
        (plain,) = world.render(take_of(real, frame), [frame], real)
        assert not same_bytes(drawn, plain)
        assert world.digests(take, real) == {frame: world.digests(changed)[frame]}


def test_a_take_may_not_hold_what_the_whole_has_not(model, real):
    for track, named in (
        (ObjectTrack("player_1", poses=(PoseKey(1, 14),)), "frame 14"),
        (ObjectTrack("player_1", styles=(StyleMix(1, "/no/state.json", "player_1", 1.0),)), "/no/"),
        (ObjectTrack("player_1", styles=(StyleMix(1, None, "nobody", 1.0),)), "nobody"),
    ):
        with pytest.raises(ShotError, match=named):
            next(world_of(model).render(take_of(real, 2, objects=(track,)), [2], real))


def test_a_lender_that_was_written_again_is_read_again(model, real, tmp_path):
    path, world = tmp_path / "other.json", world_of(model)
    track = ObjectTrack("player_1", styles=(StyleMix(1, str(path), "player_2", 1.0),))
    take = take_of(real, 2, objects=(track,))
    lender_of(real, path)
    (before,) = world.render(take, [2], real)
    content = json.loads(path.read_text())
    style = content["objects"]["player_2"]["style"]
    content["objects"]["player_2"]["style"] = [each + 3.0 for each in style]
    path.write_text(json.dumps(content))
    os.utime(path, ns=(1, 1))
    (after,) = world.render(take, [2], real)
    assert not same_bytes(after, before)


def test_regions_and_layers_of_a_real_model_come_as_bytes(model, real):
    passes = ("layer:player_1", "background", "depth")
    whole = dataclasses.replace(real, passes=passes)
    part = dataclasses.replace(whole, region=(8, 2, 20, 12))
    (all_of_it,), (some,) = (world_of(model).render(each, [3]) for each in (whole, part))
    assert some.buffers["layer:player_1"].shape == (12, 20, 4)
    assert some.buffers["layer:player_1"].dtype == some.buffers["background"].dtype == np.uint8
    for name, buffer in some.buffers.items():
        np.testing.assert_array_equal(buffer, all_of_it.buffers[name][2:14, 8:28])


def test_digests_tell_models_apart(model, real, tmp_path):
    other = tiny_model.write_model(tmp_path / "other.safetensors", seed=1)
    own = world_of(model).digests(real)
    assert len(set(own.values())) == FRAMES
    assert not set(own.values()) & set(
        world_of(other).digests(dataclasses.replace(real, model=other)).values()
    )


def test_actions_of_a_real_model_are_inferred_from_states_as_json(model, real):
    world = world_of(model)
    picture = np.zeros((16, 32, 3), np.uint8)
    state = world.encode(picture, tiny_model.camera(), tiny_model.boxes())
    found = world.infer_actions([state] * 4, [tiny_model.camera()] * 4)
    assert {name: len(each) for name, each in found.items()} == {"player_1": 3, "player_2": 3}
    assert all(each in (0, 1, 2) for own in found.values() for each in own)


def test_states_of_another_model_and_unknown_players_are_refused(model, monkeypatch, tmp_path):
    world, picture = world_of(model), np.zeros((16, 32, 3), np.uint8)
    with pytest.raises(ConfigError):
        world.infer_actions([{"format": 1, "objects": {}}], [tiny_model.camera()])
    with pytest.raises(ConfigError, match="no playable object 'ground'.*player_1, player_2"):
        world.detect(picture, ["ground"])
    monkeypatch.setattr(model_world, "OWN_DETECTOR", tmp_path / "gone.safetensors")
    with pytest.raises(ConfigError, match="no person detector"):
        world.detect(picture, ["player_1"])


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
