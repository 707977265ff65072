"""Where the runtime lives, as Blender's preferences keep it, and how it is."""

from pathlib import Path

import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.props import StringProperty

from ..panel import label_lines, wrapped_label
from ..worker import session
from ..worker.runtime_python import VARIABLE, Places, own_python
from .installation import installation
from .plan import ENVIRONMENT, bundled_wheel
from .redrawing import follow
from .runtime_state import UNKNOWN
from .words import LINE_CHARACTERS, refusal, words_of

ADDON = __package__.rpartition(".")[0]
FOLDER = Path(__file__).parents[1]


class PlayableEnvironmentPreferences(bpy.types.AddonPreferences):
    """Where the runtime lives: a Python with `playable-environments` installed."""

    bl_idname = ADDON

    runtime_python: StringProperty(
        name="Runtime Python",
        description=(
            "A Python program that has playable-environments installed. Empty: the runtime that "
            f"Set Up Runtime makes. The environment variable {VARIABLE} goes before both, so that "
            "a farm needs no preferences"
        ),
        subtype="FILE_PATH",
        update=lambda self, _context: self.apply(),
    )
    runtime_arguments: StringProperty(
        name="Arguments",
        description="More arguments for the worker, such as --device cpu",
        update=lambda self, _context: self.apply(),
    )

    def apply(self) -> None:
        """Make the next worker start with these preferences."""
        use_runtime(self.runtime_python, self.runtime_arguments)

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        # Somebody looks: only now is it worth a process to find out.
        if installation.state.kind == UNKNOWN and not installation.busy:
            installation.begin_check(session.session.places, session.session.arguments)
            follow()
        draw_state(layout.box())
        layout.prop(self, "runtime_python")
        layout.prop(self, "runtime_arguments")
        draw_set_up(layout)


def draw_state(layout: bpy.types.UILayout) -> None:
    """Show how the runtime is, in words."""
    words = words_of(installation.state, iface_)
    row = layout.row()
    row.label(text=words.title, icon=words.icon)
    row.operator("playable.check_runtime", text="", icon="FILE_REFRESH")
    row.operator("playable.stop_worker", text="", icon="CANCEL")
    label_lines(layout, words.lines, "BLANK1")


def draw_set_up(layout: bpy.types.UILayout) -> None:
    """Show what can be done about the runtime, or how far it is."""
    column = layout.column()
    if installation.sets_up:
        draw_progress(column)
        return
    row = column.row(align=True)
    row.operator("playable.set_up_runtime", icon="IMPORT")
    row.operator("playable.remove_runtime", text="Remove", icon="TRASH")
    why_not = set_up_refusal()
    wrapped_label(column, why_not, "INFO", LINE_CHARACTERS)
    if why_not and bundled_wheel(FOLDER) and not bpy.app.online_access_override:
        column.operator("extensions.userpref_show_online", text="Show the Setting")
    icon = "ERROR" if installation.failed else "INFO"
    wrapped_label(column, installation.said, icon, LINE_CHARACTERS)
    label_lines(column, installation.log, "BLANK1")


def draw_progress(layout: bpy.types.UILayout) -> None:
    """Show a set-up under way, and how to end it."""
    stage, share = installation.progress
    row = layout.row(align=True)
    row.progress(text=f"{iface_(stage)} · {share:.0%}", factor=share)
    row.operator("playable.cancel_set_up", text="", icon="CANCEL")


def set_up_refusal() -> str:
    """Why nothing can be set up now; empty: it can."""
    return refusal(
        bpy.app.online_access,
        bpy.app.online_access_override,
        bundled_wheel(FOLDER) is not None,
        installation.sets_up,
    )


def private_folder(create: bool = False) -> Path:
    """The add-on's own folder for the runtime; among the user's settings where it is no extension.

    Args:
        create: Whether to make it; else nothing is touched.
    """
    try:
        folder = bpy.utils.extension_path_user(ADDON, path="runtime", create=create)
    except ValueError:
        below = "playable_environments/runtime"
        folder = bpy.utils.user_resource("CONFIG", path=below, create=create)
    return Path(folder)


def use_runtime(chosen: str = "", arguments: str = "") -> None:
    """Look for the runtime there from now on; nothing is started or read yet."""
    own = own_python(bpy.app.binary_path)
    path = bpy.path.abspath(chosen) if chosen else ""
    places = Places(path, private_folder() / ENVIRONMENT, own)
    session.use_runtime(places, arguments.split())
    installation.forget()


def use_private_runtime() -> None:
    """Have the runtime that was set up be the one that is used."""
    kept = own_preferences()
    if kept is None:
        use_runtime()
    else:
        kept.runtime_python = ""


def own_preferences() -> PlayableEnvironmentPreferences | None:
    """The add-on's preferences; None where it was registered without being enabled."""
    addon = bpy.context.preferences.addons.get(ADDON)
    return None if addon is None else addon.preferences


def register() -> None:
    """Register the preferences and hand them to the session."""
    bpy.utils.register_class(PlayableEnvironmentPreferences)
    kept = own_preferences()
    if kept is None:
        use_runtime()
    else:
        kept.apply()


def unregister() -> None:
    """Undo `register`."""
    bpy.utils.unregister_class(PlayableEnvironmentPreferences)
