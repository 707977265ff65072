"""Operators that wait for the worker: blocking without a window, in a thread with one."""

from collections.abc import Callable
from dataclasses import dataclass

import bpy
from bpy.app.translations import pgettext_iface as iface_

from pe_runtime.contract.errors import PlayableEnvironmentError

from ..polls import rendering
from ..windows import redraw
from .background import BackgroundCall, Work
from .replies import WorkerCancelledError
from .session import session

TICK_SECONDS = 0.1
Result = set[str]


@dataclass(frozen=True)
class Task:
    """An operator's job in two halves.

    Attributes:
        work: Talks to the worker; may run in a thread and touches no Blender data.
        finish: Takes its result into Blender on the main thread and says what was done.
    """

    work: Work
    finish: Callable[[object], str]


class WorkerOperator:
    """Runs a Task: blocking when executed, with progress and Esc when invoked in a window."""

    def task(self, context: bpy.types.Context) -> Task:
        """Read the context and say what there is to do."""
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> Result:
        try:
            task = self.task(context)
            result = task.work(lambda: False, lambda *_: None)
            self.report({"INFO"}, task.finish(result))
        except PlayableEnvironmentError as error:
            return failed(self, error)
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        try:
            self._task = self.task(context)
        except PlayableEnvironmentError as error:
            return failed(self, error)
        self._call = BackgroundCall(self._task.work)
        start_modal(self, context)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if event.type == "ESC":
            self._call.cancel()
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}
        call, label = self._call, iface_(self.bl_label, "Operator")
        stage = iface_(session.doing or call.stage)
        show_progress(context, f"{label}: {stage}", call.progress)
        # A render begun meanwhile, as in another window, reads what would be written here.
        waits = rendering() and not call.cancelled
        if waits or (not call.done and not call.overdue):
            return {"RUNNING_MODAL"}
        end_modal(self, context)
        if call.cancelled:  # even if it was done by then: nobody wants to see it change the scene
            self.report({"WARNING"}, f"{self.bl_label} was cancelled")
            return {"CANCELLED"}
        try:
            self.report({"INFO"}, self._task.finish(self._call.result()))
        except WorkerCancelledError:
            self.report({"WARNING"}, f"{self.bl_label} was cancelled")
            return {"CANCELLED"}
        except PlayableEnvironmentError as error:
            return failed(self, error)
        return {"FINISHED"}


def failed(operator: bpy.types.Operator, error: Exception) -> Result:
    """Say what went wrong and give up."""
    operator.report({"ERROR"}, str(error))
    return {"CANCELLED"}


def start_modal(operator: bpy.types.Operator, context: bpy.types.Context) -> None:
    """Have the operator called at every tick, with a progress beside the pointer."""
    manager = context.window_manager
    manager.progress_begin(0, 100)
    operator._timer = manager.event_timer_add(TICK_SECONDS, window=context.window)
    manager.modal_handler_add(operator)


def end_modal(operator: bpy.types.Operator, context: bpy.types.Context) -> None:
    """Undo `start_modal`."""
    manager = context.window_manager
    manager.event_timer_remove(operator._timer)
    manager.progress_end()
    context.workspace.status_text_set(None)
    # Blender redraws what an operator changed in the scene, but not what panels say of the worker.
    redraw("VIEW_3D")


def show_progress(context: bpy.types.Context, text: str, share: float) -> None:
    """Show what is being done and how much of it is, in [0, 1]."""
    context.window_manager.progress_update(int(100 * share))
    context.workspace.status_text_set(f"{iface_(text)} · {share:.0%} · {iface_('Esc to stop')}")


def model_path(model: str) -> str:
    """A model's setting as the worker takes it: a built-in name, or a path from the root."""
    return bpy.path.abspath(model) if model.startswith("//") else model
