"""What happens when a .blend is opened or saved."""

import bpy
from bpy.app.handlers import persistent

from ..strips.relative_paths import make_relative
from .migration import migrate


@persistent
def _after_loading(*_: object) -> None:
    for scene in bpy.data.scenes:
        migrate(scene)


@persistent
def _before_saving(path: str, *_: object) -> None:
    if path:
        make_relative(path)


def _migrate_what_is_open() -> None:
    """Blender shows no data while add-ons are enabled at its start: a timer comes after that."""
    _after_loading()


def register() -> None:
    """Watch for files; what is open already is looked at as soon as Blender allows it."""
    bpy.app.handlers.load_post.append(_after_loading)
    bpy.app.handlers.save_pre.append(_before_saving)
    if not bpy.app.background:
        bpy.app.timers.register(_migrate_what_is_open, first_interval=0.0)


def unregister() -> None:
    """Undo `register`."""
    if bpy.app.timers.is_registered(_migrate_what_is_open):
        bpy.app.timers.unregister(_migrate_what_is_open)
    bpy.app.handlers.save_pre.remove(_before_saving)
    bpy.app.handlers.load_post.remove(_after_loading)
