"""Blender's own events and timer, by which live paths learn that something may have changed.

Handlers may run off the main thread, so all they do is to note it; the timer does the rest.
"""

from time import monotonic

import bpy
from bpy.app.handlers import persistent

from ..polls import rendering
from ..windows import redraw
from ..worker.session import session
from .live_paths import LivePaths

live = LivePaths(session.rollout)
RENDERING_SECONDS = 0.5
EVENTS = ("depsgraph_update_post", "undo_post", "redo_post")


@persistent
def _note_change(*_arguments: object) -> None:
    live.touch()


@persistent
def _forget_file(*_arguments: object) -> None:
    live.forget()


def _tick() -> float:
    # A render reads the scene in another thread: nothing may be written meanwhile.
    if rendering():
        return RENDERING_SECONDS
    before = [live.note(scene) for scene in bpy.data.scenes]
    seconds = live.tick(monotonic())
    if before != [live.note(scene) for scene in bpy.data.scenes]:
        redraw("VIEW_3D")
    return seconds


def register() -> None:
    """Watch Blender, where there is a window in which anybody could change something."""
    live.forget()
    if bpy.app.background:
        return
    for event in EVENTS:
        getattr(bpy.app.handlers, event).append(_note_change)
    bpy.app.handlers.load_pre.append(_forget_file)
    bpy.app.timers.register(_tick, first_interval=1.0, persistent=True)


def unregister() -> None:
    """Undo `register`."""
    live.forget()
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    for event, watcher in (
        *((event, _note_change) for event in EVENTS),
        ("load_pre", _forget_file),
    ):
        handlers = getattr(bpy.app.handlers, event)
        if watcher in handlers:
            handlers.remove(watcher)
