"""The conversation with a real worker process, without Blender."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from addon.stage import BOXES, FAKE, HEIGHT, WIDTH, faulty, front_camera, picture_of, shot_of

from blender_addon.worker.replies import WorkerCancelledError
from blender_addon.worker.session import BUSY, FAILED, READY, STOPPED, Session
from blender_addon.worker.worker_client import WorkerClient, worker_command
from pe_runtime.contract.errors import WorkerError


@pytest.fixture
def started():
    """Makes clients and stops them afterwards."""
    clients = []

    def start(command, **options):
        clients.append(WorkerClient(command, **options))
        return clients[-1]

    yield start
    for client in clients:
        client.kill()


@pytest.fixture
def session():
    each = Session()
    each.use_command(FAKE)
    yield each
    each.close()


def test_a_worker_loads_encodes_predicts_and_draws(started, picture):
    client = started(FAKE)
    facts = client.load("fake")
    assert facts.playable_names == ("player_1", "player_2")
    state = client.encode(picture_of(), front_camera(), BOXES)
    assert state["objects"]["player_1"]["position"][2] == pytest.approx(0.0, abs=1e-9)
    paths = client.rollout(shot_of(picture))
    assert paths.positions["player_2"].shape == (4, 3) and not paths.headings
    frame = client.render(shot_of(picture), 2)
    assert (frame.number, frame.rgb.shape, frame.rgb.dtype) == (2, (HEIGHT, WIDTH, 3), np.uint8)
    assert frame.depth.shape == (HEIGHT, WIDTH) and np.isinf(frame.depth).any()
    assert list(frame.masks) == ["player_1"]


def test_layers_and_background_of_a_region_come_with_the_frame(started, picture):
    client = started(FAKE)
    client.load("fake")
    passes = ("layer:player_1", "layer:player_2", "background", "mask:player_1")
    frame = client.render(shot_of(picture, passes=passes, region=(8, 4, 40, 30)), 2)
    assert list(frame.layers) == ["player_1", "player_2"] and list(frame.masks) == ["player_1"]
    for layer in frame.layers.values():
        assert (layer.shape, layer.dtype) == ((30, 40, 4), np.uint8)
    assert (frame.background.shape, frame.background.dtype) == ((30, 40, 3), np.uint8)
    np.testing.assert_array_equal(frame.layers["player_1"][..., 3] > 0, frame.masks["player_1"] > 0)
    plain = client.render(shot_of(picture), 2)
    assert plain.background is None and not plain.layers


def test_headings_are_told_apart_from_positions(started, picture):
    client = started(FAKE)
    assert client.load("turning").turning_names == ("player_1", "player_2")
    paths = client.rollout(shot_of(picture, model="turning"))
    assert set(paths.positions) == set(paths.headings) == set(BOXES)
    assert paths.headings["player_1"].shape == (4,)


def test_stop_ends_the_process_by_itself(started):
    client = started(FAKE)
    client.stop()
    assert client._process.returncode == 0


def test_a_failure_in_the_worker_names_itself_and_leaves_it_alive(started, picture):
    client = started(faulty("fails"))
    client.load("fake")
    with pytest.raises(WorkerError, match=r"the lens fell off \(CameraError\)"):
        client.render(shot_of(picture), 3)
    assert client.render(shot_of(picture), 2).number == 2


def test_an_unknown_model_is_refused_with_the_known_ones(started):
    with pytest.raises(WorkerError, match="no model 'unheard'.*duel"):
        started(FAKE).load("unheard")


def test_a_worker_that_dies_is_reported_with_its_exit_code_and_last_words(started, picture):
    client = started(faulty("dies"))
    client.load("fake")
    with pytest.raises(WorkerError, match="exit code 7") as caught:
        client.render(shot_of(picture), 3)
    assert "out of memory, or so" in str(caught.value)
    assert not client.alive


def test_a_worker_that_cannot_import_says_why(started):
    with pytest.raises(WorkerError, match="No module named 'torch'"):
        started(faulty("broken"))


def test_a_silent_worker_is_given_up_and_killed():
    with pytest.raises(WorkerError, match="did not answer 'hello' within 1 s"):
        WorkerClient(faulty("silent"), start_seconds=1.0)


def test_a_stray_print_on_the_wire_is_noticed():
    with pytest.raises(WorkerError, match="something other than the protocol"):
        WorkerClient(faulty("chatty"))


def test_a_python_that_does_not_exist_points_to_the_preferences(tmp_path):
    with pytest.raises(WorkerError, match="runtime Python in the add-on's preferences"):
        WorkerClient(worker_command(tmp_path / "python"))


def test_cancel_during_render_returns_at_once_and_the_next_request_works(started, picture):
    client = started(faulty("slow"))
    client.load("fake")
    polls = []
    with pytest.raises(WorkerCancelledError):
        client.render(shot_of(picture), 1, should_stop=lambda: polls.append(1) or len(polls) > 2)
    # It returned while the worker was still drawing: nothing has come back yet.
    assert client._inbox.empty() and client.alive
    assert client.load("fake").name == "fake"


def test_an_interrupted_request_does_not_answer_the_next_one(started, picture):
    def interrupted():
        raise KeyboardInterrupt

    client = started(faulty("slow"))
    client.load("fake")
    with pytest.raises(KeyboardInterrupt):
        client.render(shot_of(picture), 1, should_stop=interrupted)
    assert client.rollout(shot_of(picture)).positions["player_1"].shape == (4, 3)


def test_long_chatter_on_stderr_neither_blocks_nor_piles_up(started):
    program = (
        "import sys; [sys.stderr.write('x' * 999 + '\\n') for _ in range(3000)]; "
        "sys.stderr.write('the end\\n'); sys.exit(3)"
    )
    with pytest.raises(WorkerError, match="exit code 3") as caught:
        started([sys.executable, "-c", program])
    assert "the end" in str(caught.value) and len(str(caught.value)) < 30_000


def test_the_session_starts_loads_and_reports_its_status(session, picture):
    assert session.status == STOPPED
    assert session.render(shot_of(picture), 1).number == 1
    assert session.status == READY and session.worker_pid
    session.close()
    assert session.status == STOPPED and session.worker_pid is None


def test_a_killed_worker_gives_an_error_and_the_next_request_starts_another(session, picture):
    seen = []

    def kill_once():
        seen.append(session.status)
        os.kill(first, signal.SIGKILL)
        return False

    session.use_command(faulty("slow"))
    session.facts("fake")
    first = session.worker_pid
    with pytest.raises(WorkerError, match="exit code -9"):
        session.render(shot_of(picture), 1, should_stop=kill_once)
    assert BUSY in seen and session.status == FAILED and "exit code" in session.error
    session.use_command(FAKE)
    assert session.render(shot_of(picture), 1).number == 1
    assert session.worker_pid != first and session.status == READY


def test_a_worker_that_died_between_requests_is_replaced_silently(session, picture):
    session.facts("fake")
    first = session.worker_pid
    os.kill(first, signal.SIGKILL)
    session._client._process.wait()
    assert session.render(shot_of(picture), 1).number == 1
    assert session.worker_pid != first


def test_two_requests_at_once_are_refused_instead_of_mixed(session, picture):
    def nested():
        with pytest.raises(WorkerError, match="busy"):
            session.facts("fake")
        return True

    session.use_command(faulty("slow"))
    session.facts("fake")
    with pytest.raises(WorkerCancelledError):
        session.render(shot_of(picture), 1, should_stop=nested)


def test_the_client_and_the_session_need_no_blender():
    program = (
        "import sys, blender_addon, blender_addon.worker.session, blender_addon.worker.background; "
        "sys.exit(bool({'bpy', 'torch'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
