"""The worker as a process: greeting, cancelling, dying, and nothing but messages on the wire."""

import io
import subprocess
import sys

import numpy as np
import pytest
from plain_worker import HELLO, LOAD, ROOT, Worker, boxes, camera, make_shot, render

import pe_runtime
from pe_runtime.contract.messages import (
    PROTOCOL,
    REQUESTS,
    Message,
    read_message,
    write_message,
)
from pe_runtime.contract.model_facts import ModelFacts
from pe_runtime.contract.shot import Start
from pe_runtime.images import write_png
from pe_runtime.worker.fake_world import ACTIONS, FakeWorld
from pe_runtime.worker.serving import Inbox, serve
from pe_runtime.worker.world import Picture


@pytest.fixture
def start(tmp_path):
    image = tmp_path / "start.png"
    write_png(image, np.full((144, 256, 3), 90, np.uint8))
    return Start(str(image), camera(), boxes())


@pytest.fixture
def worker():
    each = Worker("--fake")
    yield each
    each.process.kill()
    each.end()


def test_hello_and_load_answer_with_the_facts_of_the_model(worker):
    greeting = worker.ask(HELLO)
    assert greeting.fields == {"protocol": PROTOCOL, "version": pe_runtime.__version__}
    facts = ModelFacts.from_fields(worker.ask(LOAD).fields)
    assert (facts.name, facts.steps_per_second, facts.width, facts.height) == (
        "duel",
        5.0,
        256,
        144,
    )
    assert facts.action_names == {"player_1": ACTIONS, "player_2": ACTIONS}


@pytest.mark.parametrize("wrong", [{"protocol": 99}, {"version": "0.0.0"}, {"version": None}])
def test_another_version_at_hello_is_refused_and_nothing_else_is_answered(worker, wrong):
    reply = worker.ask(Message("hello", HELLO.fields | wrong))
    assert reply.type == "failure"
    assert next(iter(wrong)) in reply.fields["message"]
    assert "hello first" in worker.ask(LOAD).fields["message"]


def test_an_unknown_model_is_a_failure_that_names_the_known_ones(worker):
    worker.ask(HELLO)
    reply = worker.ask(Message("load", {"model": "dual"}))
    assert reply.fields["kind"] == "CheckpointError"
    assert "duel" in reply.fields["message"]
    assert worker.ask(LOAD).type == "ready"


def test_a_request_before_load_is_a_failure_that_says_so(worker, start):
    worker.ask(HELLO)
    assert "send load first" in worker.ask(render(make_shot(start))).fields["message"]


def test_cancel_during_render_ends_it_and_the_next_render_works(worker, start):
    worker.ready()
    shot = make_shot(start, frames=400)
    worker.send(render(shot))
    assert worker.receive().type == "frame"
    worker.send(Message("cancel"))
    last = worker.until_terminal()[-1]
    assert (last.type, last.fields["kind"]) == ("failure", "cancelled")
    worker.send(render(shot, [7]))
    assert [reply.type for reply in worker.until_terminal()] == ["frame", "progress", "ready"]


def test_a_cancel_that_comes_too_late_does_not_reach_the_next_render(worker, start):
    worker.ready()
    worker.send(render(make_shot(start), [1]))
    assert worker.until_terminal()[-1].type == "ready"
    worker.send(Message("cancel"))
    worker.send(render(make_shot(start), [2]))
    assert worker.until_terminal()[-1].type == "ready"


def test_cancel_reaches_requests_that_still_wait(worker, start):
    worker.ready()
    for _ in range(3):
        worker.send(render(make_shot(start, frames=400)))
    worker.send(Message("cancel"))
    kinds = [worker.until_terminal()[-1].fields.get("kind") for _ in range(3)]
    assert kinds == ["cancelled"] * 3


def test_stop_during_render_ends_the_process_with_zero(worker, start):
    worker.ready()
    worker.send(render(make_shot(start, frames=400)))
    worker.send(Message("stop"))
    assert worker.until_terminal()[-1].fields["kind"] == "cancelled"
    assert worker.receive() is None
    assert worker.end() == 0


def test_the_end_of_stdin_ends_the_process_with_zero(worker):
    worker.ready()
    assert worker.end() == 0
    assert b"".join(worker.log) == b""


def test_half_a_message_is_a_failure_and_the_process_ends_with_one(worker):
    worker.process.stdin.write((100).to_bytes(8, "little") + b'{"type": "hel')
    worker.process.stdin.close()
    assert "inside a message" in worker.receive().fields["message"]
    assert worker.process.wait(30) == 1


def test_text_on_the_wire_is_a_failure_and_the_process_ends_with_one(worker):
    worker.process.stdin.write(b"hello worker, how are you?\n")
    worker.process.stdin.flush()
    assert "something other than the protocol" in worker.receive().fields["message"]
    assert worker.process.wait(30) == 1


def test_a_killed_worker_is_the_end_of_the_stream_and_a_new_one_works(worker, start):
    worker.ready()
    worker.process.kill()
    worker.process.wait(30)
    assert worker.receive() is None
    other = Worker("--fake")
    assert other.ready().type == "ready"
    assert other.end() == 0


def test_a_worker_whose_reader_is_gone_ends(worker, start):
    worker.ready()
    worker.send(render(make_shot(start, frames=400)))
    worker.process.stdout.close()
    assert worker.process.wait(30) == 1


PRINTING = """
import os, sys
from pe_runtime.worker import fake_world, process
def load(self, model):
    {statement}
    return original(self, model)
original, fake_world.FakeWorld.load = fake_world.FakeWorld.load, load
sys.exit(process.run_worker(fake=True))
"""


def test_a_print_in_the_worker_fails_loudly_and_never_reaches_the_wire():
    worker = Worker(code=PRINTING.format(statement="print('loading', model)"))
    worker.ask(HELLO)
    reply = worker.ask(LOAD)
    assert (reply.type, reply.fields["kind"]) == ("failure", "WorkerError")
    assert "'loading'" in reply.fields["message"]
    assert worker.end() == 0
    assert b"print('loading', model)" in b"".join(worker.log) or b"Traceback" in b"".join(
        worker.log
    )


def test_what_a_library_writes_to_file_one_goes_to_the_log():
    worker = Worker(code=PRINTING.format(statement="os.write(1, b'from a library')"))
    assert worker.ready().type == "ready"
    assert worker.end() == 0
    assert b"from a library" in b"".join(worker.log)


def test_a_bug_in_the_world_is_a_failure_with_its_traceback_in_the_log():
    worker = Worker(code=PRINTING.format(statement="raise ZeroDivisionError('oops')"))
    worker.ask(HELLO)
    assert worker.ask(LOAD).fields["kind"] == "ZeroDivisionError"
    assert worker.end() == 0
    assert b"Traceback" in b"".join(worker.log)


def test_the_fake_worker_never_imports_torch():
    code = (
        "import sys; from pe_runtime.worker.fake_world import FakeWorld; "
        "FakeWorld().load('duel'); import pe_runtime.worker.process; "
        "sys.exit('torch' in sys.modules or 'OpenImageIO' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT).returncode == 0


def test_every_request_type_has_an_answer():
    class Everything(FakeWorld):
        def render(self, shot, frames):
            for frame in frames:
                yield Picture(frame, {"rgb": np.zeros((2, 2, 3), np.uint8)})

    for name in set(REQUESTS) - {"cancel", "stop"}:
        source, sink = io.BytesIO(), io.BytesIO()
        for message in (HELLO, Message(name, {"model": "duel"}), Message("stop")):
            write_message(source, message)
        source.seek(0)
        assert serve(Everything, Inbox(source), sink) == 0
        sink.seek(0)
        read_message(sink)
        reply = read_message(sink)
        assert "is no request" not in reply.fields.get("message", "")


def test_a_reply_as_a_request_is_refused(worker):
    assert "is no request" in worker.ask(Message("ready")).fields["message"]
