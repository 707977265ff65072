"""The state of the runtime, beside the other panels."""

import os

import bpy

from ..panel import PlayablePanel
from ..runtime_python import find_python
from ..session import session
from .installation import installation
from .preferences import ADDON, draw_progress
from .words import worker_words


class PLAYABLE_PT_runtime(PlayablePanel, bpy.types.Panel):
    """What the worker is doing, and what to do where there is no runtime."""

    bl_label = "Runtime"
    bl_idname = "PLAYABLE_PT_runtime"
    bl_order = 9

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        has_runtime = session.has_command or find_python(session.places, os.environ) is not None
        words = worker_words(
            session.status, session.doing, session.device, session.error, has_runtime
        )
        row = layout.row(align=True)
        row.label(text=words.title, icon=words.icon)
        row.operator("playable.stop_worker", text="", icon="CANCEL")
        row.operator("preferences.addon_show", text="", icon="PREFERENCES").module = ADDON
        for line in words.lines:
            layout.label(text=line)
        if installation.sets_up:
            draw_progress(layout)
        elif not has_runtime:
            layout.operator("playable.set_up_runtime", icon="IMPORT")


CLASSES = (PLAYABLE_PT_runtime,)


def register() -> None:
    """Register the panel."""
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister() -> None:
    """Undo `register`."""
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
