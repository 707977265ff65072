"""Frames that the worker begins before Blender asks: right or wrong guesses, the same bytes."""

import dataclasses
import time

import numpy as np
import pytest
from addon.stage import FAKE, faulty, front_camera, read_png, shot_of

from blender_addon.worker import worker_client
from blender_addon.worker.replies import WorkerCancelledError
from blender_addon.worker.session import Session
from blender_addon.worker.worker_client import WorkerClient


def take_of(whole, frame, **changes):
    """One frame of a shot, as the engine asks for it."""
    fields = {"frame_start": frame, "frame_end": frame, "cameras": (whole.camera_at(frame),)}
    return dataclasses.replace(whole, **(fields | changes))


@pytest.fixture
def whole(picture):
    return shot_of(picture)


@pytest.fixture
def start():
    """Makes clients that note what they send, and stops them afterwards."""
    clients = []

    def started(command):
        client = WorkerClient(command)
        clients.append(client)
        client.load("fake")
        client.sent, send = [], client._send
        client._send = lambda message: client.sent.append(message.type) or send(message)
        return client

    yield started
    for client in clients:
        client.kill()


def test_the_whole_shot_travels_once_and_takes_show_its_frames(start, whole):
    client = start(FAKE)
    for frame in (1, 3, 2):
        drawn = client.render(take_of(whole, frame), frame, whole=whole)
        expected = client.render(whole, frame)
        assert drawn.rgb.tobytes() == expected.rgb.tobytes()
        assert drawn.depth.tobytes() == expected.depth.tobytes()
        assert drawn.masks["player_1"].tobytes() == expected.masks["player_1"].tobytes()
        assert 0 < drawn.seconds < 60
    assert client.sent == ["prepare", *["render"] * 6]


def test_another_shot_or_another_model_is_sent_again(start, whole):
    client = start(FAKE)
    client.render(take_of(whole, 1), 1, whole=whole)
    other = dataclasses.replace(whole, objects=())
    client.render(take_of(other, 1), 1, whole=other)
    client.load("fake")
    client.render(take_of(other, 1), 1, whole=other)
    assert client.sent == ["prepare", "render", "prepare", "render", "load", "prepare", "render"]


def test_a_frame_that_was_foreseen_is_asked_for_once(start, whole):
    client = start(FAKE)
    client.render(take_of(whole, 1), 1, whole=whole)
    client.foresee(take_of(whole, 2), 2, whole)
    drawn = client.render(take_of(whole, 2), 2, whole=whole)
    assert client.sent == ["prepare", "render", "render"]
    assert drawn.rgb.tobytes() == client.render(whole, 2).rgb.tobytes()


def elsewhere(whole):
    moved = front_camera().world_from_camera.copy()
    moved[0, 3] += 1.0
    camera = dataclasses.replace(front_camera(), world_from_camera=moved)
    return take_of(whole, 2, cameras=(camera,)), 2


@pytest.mark.parametrize(
    "wanted",
    [elsewhere, lambda whole: (take_of(whole, 3), 3), lambda whole: (take_of(whole, 2), 2)],
    ids=["seen from elsewhere", "another frame", "with other passes"],
)
def test_after_a_wrong_guess_the_answer_is_right_all_the_same(start, whole, wanted):
    client, (take, frame) = start(FAKE), wanted(whole)
    client.foresee(take_of(whole, 2, passes=()), 2, whole)
    drawn = client.render(take, frame, whole=whole)
    assert drawn.number == frame and drawn.depth is not None
    assert drawn.rgb.tobytes() == start(FAKE).render(take, frame, whole=whole).rgb.tobytes()
    assert client.rollout(whole).positions["player_1"].shape == (4, 3)


def test_a_wrong_guess_may_take_its_time(start, whole, monkeypatch):
    monkeypatch.setattr(worker_client, "CANCEL_SECONDS", 0.0)
    client = start(faulty("slow"))
    client.foresee(take_of(whole, 2), 2, whole)
    time.sleep(0.3)  # by now it draws, for a second
    assert client.render(take_of(whole, 3), 3, whole=whole).number == 3


def test_a_wrong_guess_does_not_keep_esc_from_working(start, whole):
    client, asked = start(faulty("slow")), []
    client.foresee(take_of(whole, 2), 2, whole)
    with pytest.raises(WorkerCancelledError):
        client.render(take_of(whole, 3), 3, lambda: asked.append(1) or True, whole)
    assert len(asked) == 1
    assert client.render(take_of(whole, 3), 3, whole=whole).number == 3


def test_what_goes_wrong_while_foreseeing_is_said_when_the_frame_is_wanted(picture):
    session, whole = Session(), shot_of(picture)
    session.use_command(faulty("fails"))
    session.foresee(take_of(whole, 3), 3, whole)
    with pytest.raises(Exception, match="the lens fell off"):
        session.render(take_of(whole, 3), 3, whole=whole)
    session.use_command(["/nowhere/python"])
    session.foresee(take_of(whole, 3), 3, whole)
    assert "cannot start the runtime" in session.error
    session.close()


class TestInBlender:
    """What the engine foresees of a range."""

    pytestmark = pytest.mark.blender

    @pytest.fixture
    def foreseen(self, environment, monkeypatch):
        import bpy

        bpy.ops.playable.bake_paths()
        frames, foresee = [], Session.foresee
        monkeypatch.setattr(
            Session,
            "foresee",
            lambda self, take, frame, *rest: (
                frames.append(frame) or foresee(self, take, frame, *rest)
            ),
        )
        return frames

    def film(self, scene, folder):
        import bpy

        scene.render.image_settings.color_mode = "RGB"
        scene.render.filepath = str(folder / "f_####")
        bpy.ops.render.render(animation=True, scene=scene.name)
        return [read_png(path) for path in sorted(folder.glob("*.png"))]

    def test_a_range_as_baked_is_foreseen_to_its_end(self, environment, foreseen, tmp_path):
        ahead = self.film(environment, tmp_path / "ahead")
        assert foreseen == [2, 3, 4]
        environment.frame_step = 2
        self.film(environment, tmp_path / "step")
        assert foreseen == [2, 3, 4, 3]
        environment.frame_step, environment.render.use_overwrite = 1, False
        assert np.array_equal(ahead, self.film(environment, tmp_path / "alone"))
        assert foreseen == [2, 3, 4, 3]

    def test_a_camera_that_leaves_its_baked_way_is_followed(
        self, environment, foreseen, monkeypatch, tmp_path
    ):
        camera = environment.camera
        for frame, x in ((2, 0.0), (3, 1.0), (4, 0.0)):
            camera.location.x = x
            camera.keyframe_insert("location", frame=frame)
        with_guesses = self.film(environment, tmp_path / "with")
        # Frame 3 is guessed as baked, which it is not; so nothing is guessed of frame 4.
        assert foreseen == [2, 3]
        monkeypatch.setattr(Session, "foresee", lambda *_: None)
        assert np.array_equal(with_guesses, self.film(environment, tmp_path / "without"))
        assert len({frame.tobytes() for frame in with_guesses}) == 4

    def test_stills_and_several_view_layers_foresee_nothing(self, environment, foreseen, tmp_path):
        import bpy

        bpy.ops.render.render(scene=environment.name)
        environment.view_layers.new("second")
        self.film(environment, tmp_path / "layers")
        assert foreseen == []
