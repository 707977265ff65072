"""Operators that wait in a window: what they finish, and what Esc leaves undone."""

import threading
import time
from types import SimpleNamespace

import pytest

bpy = pytest.importorskip("bpy")
from blender_addon import playables, polls  # noqa: E402 - after the check for Blender
from blender_addon.scene_bridge import playable_objects  # noqa: E402
from blender_addon.worker import worker_operator  # noqa: E402
from blender_addon.worker.replies import WorkerCancelledError  # noqa: E402
from blender_addon.worker.session import session  # noqa: E402
from blender_addon.worker.worker_operator import Task, WorkerOperator  # noqa: E402
from pe_runtime.contract.errors import ShotError  # noqa: E402

pytestmark = pytest.mark.blender
MINUTE = 60.0


class Operator(WorkerOperator):
    """An operator with a given work, as Blender would run it."""

    bl_label = "Do It"

    def __init__(self, work):
        self.work, self.finished, self.reports = work, [], []

    def task(self, _):
        return Task(self.work, lambda result: self.finished.append(result) or f"done: {result}")

    def report(self, kind, text):
        self.reports.append((*kind, text))


class Window:
    """The parts of Blender's context that a modal operator talks to."""

    def __init__(self):
        self.begun, self.shown, self.status = 0, [], []
        self.window_manager = SimpleNamespace(
            windows=(),
            progress_begin=lambda *_: self._change(1),
            progress_end=lambda: self._change(-1),
            progress_update=self.shown.append,
            event_timer_add=lambda *_, **__: "timer",
            event_timer_remove=lambda _: None,
            modal_handler_add=lambda _: None,
        )
        self.workspace = SimpleNamespace(status_text_set=self.status.append)
        self.window = None

    def _change(self, step):
        self.begun += step

    def tick(self, operator, kind="TIMER"):
        return operator.modal(self, SimpleNamespace(type=kind))

    def wait(self, operator):
        deadline = time.monotonic() + MINUTE
        while (answer := self.tick(operator)) == {"RUNNING_MODAL"}:
            assert time.monotonic() < deadline
            time.sleep(0.01)
        return answer


@pytest.fixture
def window():
    made = Window()
    yield made
    assert made.begun == 0 and made.status[-1] is None


def test_a_task_is_finished_and_its_stages_are_shown(window, monkeypatch):
    go_on = threading.Event()

    def work(_, on_progress):
        on_progress("reading", 1, 4)
        assert go_on.wait(MINUTE)
        return 7

    operator = Operator(work)
    assert operator.invoke(window, None) == {"RUNNING_MODAL"}
    while operator._call.progress < 0.25:
        time.sleep(0.01)
    window.tick(operator)
    assert window.shown[-1] == 25 and "Do It: reading · 25%" in window.status[-1]
    monkeypatch.setattr(session, "doing", "Loading the model")
    window.tick(operator)
    assert "Do It: Loading the model" in window.status[-1]
    go_on.set()
    assert window.wait(operator) == {"FINISHED"}
    assert operator.finished == [7] and operator.reports == [("INFO", "done: 7")]


def test_esc_ends_it_and_nothing_changes(window):
    def work(should_stop, _):
        while not should_stop():
            time.sleep(0.01)
        raise WorkerCancelledError("stopped")

    operator = Operator(work)
    operator.invoke(window, None)
    window.tick(operator, "ESC")
    assert window.wait(operator) == {"CANCELLED"}
    assert operator.finished == [] and operator.reports == [("WARNING", "Do It was cancelled")]


def test_esc_ends_it_also_where_the_work_does_not_listen_or_was_done_already(window):
    go_on = threading.Event()
    deaf = Operator(lambda *_: go_on.wait(MINUTE))
    deaf.invoke(window, None)
    window.tick(deaf, "ESC")
    assert window.wait(deaf) == {"CANCELLED"} and not deaf._call.done
    go_on.set()
    deaf._call.result()
    quick = Operator(lambda *_: 7)
    quick.invoke(window, None)
    quick._call.result()
    window.tick(quick, "ESC")
    assert window.wait(quick) == {"CANCELLED"}
    assert deaf.finished == quick.finished == []


def test_what_goes_wrong_is_reported(window):
    def work(*_):
        raise ShotError("the lens fell off")

    operator = Operator(work)
    operator.invoke(window, None)
    assert window.wait(operator) == {"CANCELLED"}
    assert operator.reports == [("ERROR", "the lens fell off")]
    assert operator.execute(window) == {"CANCELLED"}


def test_what_was_done_during_a_render_is_taken_in_after_it(window, monkeypatch):
    renders = [True]
    monkeypatch.setattr(worker_operator, "rendering", lambda: renders[0])
    operator = Operator(lambda *_: 7)
    operator.invoke(window, None)
    operator._call.result()
    assert window.tick(operator) == {"RUNNING_MODAL"} and operator.finished == []
    renders[0] = False
    assert window.wait(operator) == {"FINISHED"} and operator.finished == [7]


@pytest.mark.parametrize("name", ["bake_paths", "jump_to_action_key", "actions_from_clip"])
def test_nothing_goes_through_the_frames_of_a_scene_that_is_rendered(
    environment, name, monkeypatch
):
    player = playable_objects(environment)["player_1"]
    playables.key_action(player, 3, 1)
    bpy.context.view_layer.objects.active = player
    player.select_set(True)
    operator = getattr(bpy.ops.playable, name)
    assert operator.poll()
    monkeypatch.setattr(polls, "rendering", lambda: True)
    assert not operator.poll()
