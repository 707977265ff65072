"""Where the runtime lives, as Blender's preferences keep it."""

import bpy
from bpy.props import StringProperty

from .. import session

ADDON = __package__.rpartition(".")[0]


class PlayableEnvironmentPreferences(bpy.types.AddonPreferences):
    """Where the runtime lives: a Python with `playable-environments` installed."""

    bl_idname = ADDON

    runtime_python: StringProperty(
        name="Runtime Python",
        description="Python executable that has playable-environments installed",
        subtype="FILE_PATH",
        update=lambda self, _context: self.apply(),
    )
    runtime_arguments: StringProperty(
        name="Arguments",
        description="More arguments for the worker, for example --fake",
        update=lambda self, _context: self.apply(),
    )

    def apply(self) -> None:
        """Make the next worker start with these preferences."""
        session.use_python(self.runtime_python, self.runtime_arguments.split())

    def draw(self, _context: bpy.types.Context) -> None:
        self.layout.prop(self, "runtime_python")
        self.layout.prop(self, "runtime_arguments")


def apply_preferences() -> None:
    """Hand the preferences, if the add-on is enabled and has any, to the session."""
    addon = bpy.context.preferences.addons.get(ADDON)
    if addon is not None and addon.preferences is not None:
        addon.preferences.apply()


def register() -> None:
    """Register the preferences and hand them to the session."""
    bpy.utils.register_class(PlayableEnvironmentPreferences)
    apply_preferences()


def unregister() -> None:
    """Undo `register`."""
    bpy.utils.unregister_class(PlayableEnvironmentPreferences)
