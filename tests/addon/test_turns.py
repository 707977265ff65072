"""Callers of the worker take turns: previews make way, others wait, nobody waits for ever."""

import threading

import pytest
from addon.stage import FAKE, faulty, shot_of

from blender_addon.worker import turns
from blender_addon.worker.background import BackgroundCall
from blender_addon.worker.replies import WorkerCancelledError
from blender_addon.worker.session import READY, Session
from blender_addon.worker.turns import Turns
from pe_runtime.contract.errors import WorkerError

MINUTE = 60.0


@pytest.fixture
def session():
    each = Session()
    yield each
    each.close()


class Holder:
    """Has the turn in a thread until it is told to let go."""

    def __init__(self, queue, yielding=False):
        self._let_go, has_it = threading.Event(), threading.Event()

        def hold(should_stop, _):
            with queue.taken(yielding):
                has_it.set()
                while not (self._let_go.wait(0.01) or (yielding and queue.wanted)):
                    assert not should_stop()

        self.call = BackgroundCall(hold)
        assert has_it.wait(MINUTE)

    def release(self):
        self._let_go.set()
        self.call.result()


def test_a_plain_caller_waits_for_its_turn_and_gets_it():
    queue, order = Turns(), []
    first = Holder(queue)

    def second(*_):
        with queue.taken():
            order.append("second")

    waiting = BackgroundCall(second)
    while not queue.wanted:
        assert not waiting.done
    order.append("first")
    first.release()
    waiting.result()
    assert order == ["first", "second"] and not queue.wanted


def test_a_yielding_caller_gives_up_where_a_plain_one_has_the_turn():
    queue = Turns()
    first = Holder(queue)
    with pytest.raises(WorkerCancelledError, match="made way"), queue.taken(yielding=True):
        pytest.fail("it had the turn")
    first.release()
    with queue.taken(yielding=True):
        assert queue.mine
    assert not queue.mine


def test_a_yielding_caller_makes_way_and_two_of_them_wait_for_each_other():
    queue = Turns()
    preview = Holder(queue, yielding=True)
    with queue.taken():
        assert preview.call.result() is None
    preview = Holder(queue, yielding=True)
    path = BackgroundCall(lambda *_: Holder(queue, yielding=True))
    preview.release()
    path.result().release()


def test_waiting_ends_with_esc_or_with_patience():
    queue = Turns()
    first = Holder(queue)
    with pytest.raises(WorkerCancelledError), queue.taken(should_stop=lambda: True):
        pytest.fail("it had the turn")
    with pytest.raises(WorkerError, match="busy with another request"), queue.taken(patience=0.1):
        pytest.fail("it had the turn")
    assert not queue.wanted
    first.release()


def test_a_question_inside_anothers_callback_is_refused_at_once():
    queue = Turns()
    with queue.taken(), pytest.raises(WorkerError, match="busy"), queue.taken(patience=MINUTE):
        pytest.fail("it had the turn")
    with queue.taken(yielding=True):
        assert queue.mine


def test_the_main_thread_waits_less_long_than_others():
    elsewhere = BackgroundCall(lambda *_: turns._usual_patience())
    assert turns._usual_patience() < elsewhere.result()


def drawing_slowly(session, picture, frame, yielding=False):
    """A render in a thread that is under way."""
    begun = threading.Event()

    def work(should_stop, _):
        def stop():
            begun.set()
            return should_stop()

        return session.render(shot_of(picture), frame, stop, yielding=yielding)

    call = BackgroundCall(work)
    assert begun.wait(MINUTE)
    return call


def test_a_preview_gives_way_to_a_render_and_both_end_well(session, picture):
    session.use_command(faulty("slow"))
    session.facts("fake")
    preview = drawing_slowly(session, picture, 1, yielding=True)
    assert session.render(shot_of(picture), 2).number == 2
    with pytest.raises(WorkerCancelledError):
        preview.result()
    assert session.status == READY
    assert session.render(shot_of(picture), 3, yielding=True).number == 3


def test_two_renders_at_once_are_both_answered(session, picture):
    session.use_command(faulty("slow"))
    session.facts("fake")
    other = drawing_slowly(session, picture, 1)
    assert session.render(shot_of(picture), 2).number == 2
    assert other.result().number == 1


def test_a_preview_leaves_a_frame_alone_that_is_about_to_be_asked_for(session, picture):
    session.use_command(faulty("slow"))
    whole = shot_of(picture)
    take = shot_of(picture, 1)
    session.foresee(take, 1, whole)
    with pytest.raises(WorkerCancelledError, match="made way for the frame that comes next"):
        session.render(take, 1, whole=whole, yielding=True)
    assert session.render(take, 1, whole=whole).number == 1
    assert session.render(take, 1, whole=whole, yielding=True).number == 1


def test_closing_ends_a_request_that_is_under_way(session, picture):
    session.use_command(faulty("slow"))
    session.facts("fake")
    call, pid = drawing_slowly(session, picture, 1), session.worker_pid
    session.close()
    assert session.worker_pid is None
    with pytest.raises(WorkerCancelledError):
        call.result()
    session.use_command(FAKE)
    assert session.render(shot_of(picture), 1).number == 1 and session.worker_pid != pid


def test_esc_ends_the_start_of_a_worker_and_leaves_no_process(session, monkeypatch):
    from blender_addon.worker.worker_client import WorkerClient

    processes, launch = [], WorkerClient._launch
    monkeypatch.setattr(
        WorkerClient, "_launch", lambda self: processes.append(launch(self)) or processes[-1]
    )
    session.use_command(faulty("silent"))
    with pytest.raises(WorkerCancelledError):
        session.facts("fake", lambda: True)
    assert [process.poll() is not None for process in processes] == [True]
    session.use_command(FAKE)
    assert session.facts("fake").name == "fake"


def test_loading_goes_on_when_it_is_given_up_and_is_not_done_twice(session):
    from blender_addon.worker.worker_client import WorkerClient

    session.use_command(faulty("slow_to_load"))
    with pytest.raises(WorkerCancelledError):
        session.facts("fake", _after_the_start(session))
    sent, send = [], WorkerClient._send
    client = session._client
    client._send = lambda message: sent.append(message.type) or send(client, message)
    assert session.facts("fake").name == "fake"
    assert sent == []
    with pytest.raises(WorkerCancelledError):
        session.facts("turning", _after_the_start(session))
    assert session.facts("still").action_names["player_1"] == ()
    assert sent == ["load", "cancel", "load"]


def _after_the_start(session):
    return lambda: session._client is not None


def test_a_worker_that_does_not_end_what_was_cancelled_is_replaced(session, picture, monkeypatch):
    from blender_addon.worker import worker_client

    session.use_command(faulty("slow"))
    session.facts("fake")
    first = session.worker_pid
    with pytest.raises(WorkerCancelledError):
        session.render(shot_of(picture), 1, lambda: True)
    monkeypatch.setattr(worker_client, "CANCEL_SECONDS", 0.0)
    assert session.render(shot_of(picture), 2).number == 2
    assert session.worker_pid != first
