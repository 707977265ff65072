"""The state of the runtime, beside the other panels."""

import bpy

from ..panel import PlayablePanel
from ..session import session


class PLAYABLE_PT_runtime(PlayablePanel, bpy.types.Panel):
    """What the worker is doing."""

    bl_label = "Runtime"
    bl_idname = "PLAYABLE_PT_runtime"
    bl_order = 9

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        row = layout.row(align=True)
        row.label(text=f"Worker: {session.status}", icon="ERROR" if session.error else "CONSOLE")
        row.operator("playable.stop_worker", text="", icon="CANCEL")
        if session.error:
            layout.label(text=session.error.splitlines()[0])


CLASSES = (PLAYABLE_PT_runtime,)


def register() -> None:
    """Register the panel."""
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister() -> None:
    """Undo `register`."""
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
