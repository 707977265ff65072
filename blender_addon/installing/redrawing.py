"""Keeps windows up to date while something is done about the runtime."""

import bpy

from .. import windows
from .installation import installation

SECONDS = 0.25
SHOWN_IN = ("PREFERENCES", "VIEW_3D", "PROPERTIES")


def follow() -> None:
    """Show what is under way until it has ended; without a window nothing would be shown."""
    if not bpy.app.background and not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=SECONDS)


def redraw() -> None:
    """Have every place drawn anew that tells of the runtime."""
    windows.redraw(*SHOWN_IN)


def unregister() -> None:
    """Follow nothing any more."""
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)


def _tick() -> float | None:
    installation.settle()
    redraw()
    return SECONDS if installation.busy else None
