"""The add-on in other languages: its English strings are the keys, German is complete.

Looked up is what somebody sees all the time: labels, tooltips, why a button is grey, progress.
Errors, reports and warnings that are put together from names and numbers stay English, so that
whoever searches the web for one finds what others have said of it; and so does whatever comes from
a model, like the names of its actions.

Blender asks its own catalogue first. Where that says something else than is meant here, a property
has a `translation_context` of ours.
"""

import bpy

ADDON = __package__.rpartition(".")[0]


def register() -> None:
    """Let Blender look up the add-on's words."""
    from . import german

    bpy.app.translations.register(ADDON, {"de_DE": german.words()})


def unregister() -> None:
    """Undo `register`."""
    bpy.app.translations.unregister(ADDON)
