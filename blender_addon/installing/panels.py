"""The state of the runtime, beside the other panels."""

import os

import bpy
from bpy.app.translations import pgettext_iface as iface_

from ..panel import PlayablePanel, label_lines, wrapped_label
from ..worker.runtime_python import find_python
from ..worker.session import session
from .installation import installation
from .preferences import ADDON, draw_progress, set_up_refusal
from .words import WAY, worker_words


class PLAYABLE_PT_set_up(PlayablePanel, bpy.types.Panel):
    """Before anything else: where there is no runtime yet, the way to one."""

    bl_label = "Set Up"
    bl_idname = "PLAYABLE_PT_set_up"
    bl_order = 0

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        return not has_runtime() or installation.sets_up

    def draw(self, _context: bpy.types.Context) -> None:
        draw_way_to_a_runtime(self.layout)


class PLAYABLE_PT_runtime(PlayablePanel, bpy.types.Panel):
    """What the worker is doing."""

    bl_label = "Runtime"
    bl_idname = "PLAYABLE_PT_runtime"
    bl_order = 9

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        return has_runtime()

    def draw(self, _context: bpy.types.Context) -> None:
        draw_worker(self.layout)


def has_runtime() -> bool:
    """Whether there is anything to start; whether it starts, preferences and errors tell."""
    return session.has_command or find_python(session.places, os.environ) is not None


def draw_way_to_a_runtime(layout: bpy.types.UILayout) -> None:
    """Show how to get a runtime, or how far it is."""
    if installation.sets_up:
        draw_progress(layout)
        return
    wrapped_label(layout, WAY, "INFO")
    layout.operator("playable.set_up_runtime", icon="IMPORT")
    wrapped_label(layout, set_up_refusal(), "ERROR")
    preferences = layout.operator("preferences.addon_show", text="Preferences", icon="PREFERENCES")
    preferences.module = ADDON


def draw_worker(layout: bpy.types.UILayout) -> None:
    """Show what the worker does."""
    now = session.status, session.doing, session.device, session.error
    words = worker_words(*now, iface_)
    row = layout.row(align=True)
    row.label(text=words.title, icon=words.icon)
    row.operator("playable.stop_worker", text="", icon="CANCEL")
    row.operator("preferences.addon_show", text="", icon="PREFERENCES").module = ADDON
    label_lines(layout, words.lines, "BLANK1")


CLASSES = (PLAYABLE_PT_set_up, PLAYABLE_PT_runtime)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
