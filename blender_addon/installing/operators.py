"""What can be done about the runtime and its worker."""

import atexit
import sys

import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.props import EnumProperty, StringProperty

from pe_runtime.contract.errors import PlayableEnvironmentError

from ..panel import label_lines, wrapped_label
from ..polls import allowed
from ..worker.session import session
from ..worker.worker_operator import Result, failed
from . import redrawing
from .installation import DONE, installation
from .plan import (
    CPU,
    ENVIRONMENT,
    GPU,
    SetUpError,
    SetUpPlan,
    base_python,
    bundled_wheel,
    offers_choice,
)
from .preferences import FOLDER, private_folder, set_up_refusal, use_private_runtime
from .set_up import remove
from .words import LINE_CHARACTERS, processor_hint, question_lines, short_words

DIALOG_WIDTH = 520
TICK_SECONDS = 0.25
PROCESSORS = (
    (CPU, "CPU", "Runs on every computer; the smaller download"),
    (GPU, "NVIDIA GPU", "Many times faster with an NVIDIA card; a far larger download"),
)


class PLAYABLE_OT_set_up_runtime(bpy.types.Operator):
    """Build a private Python with the runtime in the add-on's folder; Remove takes it away again"""

    bl_idname = "playable.set_up_runtime"
    bl_label = "Set Up Runtime"

    processor: EnumProperty(
        name="Processor", description="What the runtime will compute on", items=PROCESSORS
    )
    base_python: StringProperty(
        name="Python",
        description="The Python, 3.11 to 3.14, that the private one is made of. Empty: Blender's",
        subtype="FILE_PATH",
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        why_not = set_up_refusal()
        return allowed(cls, not why_not, why_not)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        return context.window_manager.invoke_props_dialog(
            self, width=DIALOG_WIDTH, title="Set Up the Runtime?", confirm_text="Set Up"
        )

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        try:
            plan = self._plan()
        except PlayableEnvironmentError as error:
            wrapped_label(layout, str(error), "ERROR", LINE_CHARACTERS)
        else:
            label_lines(layout, question_lines(plan, iface_))
            if offers_choice():
                layout.prop(self, "processor", expand=True)
                layout.label(text=processor_hint(plan), icon="INFO")
        layout.prop(self, "base_python")

    def execute(self, context: bpy.types.Context) -> Result:
        # The poll may be older than a change of the preferences.
        if why_not := set_up_refusal():
            return failed(self, SetUpError(why_not))
        try:
            installation.begin_set_up(self._plan(), session.close, use_private_runtime)
        except PlayableEnvironmentError as error:
            return failed(self, error)
        if bpy.app.background or context.window is None:
            return self._wait()
        redrawing.follow()
        manager = context.window_manager
        self._area = _rectangle(context.area)
        self._timer = manager.event_timer_add(TICK_SECONDS, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        # Minutes pass: everything else goes on, and Esc counts only where this was started.
        if event.type == "ESC" and _holds(self._area, event.mouse_x, event.mouse_y):
            installation.cancel()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        installation.settle()
        if installation.sets_up:
            return {"PASS_THROUGH"}
        self.cancel(context)
        redrawing.redraw()
        return self._end()

    def cancel(self, context: bpy.types.Context) -> None:
        # The window or the file was closed; the set-up goes on and shows in others.
        context.window_manager.event_timer_remove(self._timer)

    def _plan(self) -> SetUpPlan:
        wheel = bundled_wheel(FOLDER)
        chosen = bpy.path.abspath(self.base_python) if self.base_python else ""
        python = chosen or base_python(sys.executable, sys.base_prefix)
        if wheel is None or not python:
            raise SetUpError("Blender's own Python was not found; choose a Python 3.11 to 3.14")
        processor = self.processor if offers_choice() else CPU
        return SetUpPlan(python, wheel, private_folder(), processor)

    def _wait(self) -> Result:
        try:
            installation.settle(wait=True)
        except BaseException:
            installation.end()
            raise
        return self._end()

    def _end(self) -> Result:
        if installation.failed:
            # With a window the preferences show the rest.
            log = installation.log if bpy.app.background else ()
            return failed(self, SetUpError("\n".join((installation.said, *log))))
        if installation.said != DONE:
            self.report({"WARNING"}, installation.said)
            return {"CANCELLED"}
        self.report({"INFO"}, f"{DONE}. {short_words(installation.state)}")
        return {"FINISHED"}


class PLAYABLE_OT_cancel_set_up(bpy.types.Operator):
    """Stop setting up the runtime; nothing of it stays, and an older one is untouched"""

    bl_idname = "playable.cancel_set_up"
    bl_label = "Stop Setting Up"

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        return allowed(cls, installation.sets_up, "Nothing is being set up")

    def execute(self, _context: bpy.types.Context) -> Result:
        installation.cancel()
        return {"FINISHED"}


class PLAYABLE_OT_remove_runtime(bpy.types.Operator):
    """Delete the runtime that Set Up Runtime made; a Python that you chose is left alone"""

    bl_idname = "playable.remove_runtime"
    bl_label = "Remove the Runtime?"

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        if not allowed(cls, not installation.sets_up, "The runtime is being set up"):
            return False
        has_one = (private_folder() / ENVIRONMENT).is_dir()
        return allowed(cls, has_one, "Nothing was set up that could be removed")

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        return context.window_manager.invoke_confirm(
            self,
            event,
            title="Remove the Runtime?",
            message=iface_("{folder} will be deleted").format(
                folder=private_folder() / ENVIRONMENT
            ),
            confirm_text="Remove",
        )

    def execute(self, _context: bpy.types.Context) -> Result:
        session.close()
        try:
            remove(private_folder())
        except PlayableEnvironmentError as error:
            return failed(self, error)
        installation.end()
        self.report({"INFO"}, "The runtime was removed")
        return {"FINISHED"}


class PLAYABLE_OT_check_runtime(bpy.types.Operator):
    """Start the runtime once and tell its version and what it computes on"""

    bl_idname = "playable.check_runtime"
    bl_label = "Check Again"

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        return allowed(cls, not installation.busy, "Something is under way already")

    def execute(self, context: bpy.types.Context) -> Result:
        installation.begin_check(session.places, session.arguments)
        if bpy.app.background or context.window is None:
            installation.settle(wait=True)
            self.report({"INFO"}, short_words(installation.state))
        else:
            redrawing.follow()
        return {"FINISHED"}


class PLAYABLE_OT_stop_worker(bpy.types.Operator):
    """End the worker process, which frees its memory; the next request starts another"""

    bl_idname = "playable.stop_worker"
    bl_label = "Stop Worker"

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        return allowed(cls, session.worker_pid is not None, "No worker is running")

    def execute(self, _context: bpy.types.Context) -> Result:
        session.close()
        return {"FINISHED"}


def _rectangle(area: bpy.types.Area | None) -> tuple[int, int, int, int]:
    return (0, 0, 0, 0) if area is None else (area.x, area.y, area.width, area.height)


def _holds(area: tuple[int, int, int, int], x: int, y: int) -> bool:
    left, bottom, width, height = area
    return left <= x < left + width and bottom <= y < bottom + height


CLASSES = (
    PLAYABLE_OT_set_up_runtime,
    PLAYABLE_OT_cancel_set_up,
    PLAYABLE_OT_remove_runtime,
    PLAYABLE_OT_check_runtime,
    PLAYABLE_OT_stop_worker,
)


def register() -> None:
    """Register the operators; what they began ends with Blender."""
    for each in CLASSES:
        bpy.utils.register_class(each)
    atexit.register(installation.end)


def unregister() -> None:
    """Undo `register`, and end what is under way."""
    installation.end()
    redrawing.unregister()
    atexit.unregister(installation.end)
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
