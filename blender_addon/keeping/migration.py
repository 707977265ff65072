"""Scenes that other versions of the add-on saved.

Reading understands every older form, so that a render farm needs no migration; migrating only
writes the newest form down, where the artist will save it.
"""

from collections.abc import Callable

import bpy

from pe_runtime.contract.errors import ShotError

from ..bake import bake_of
from ..settings import SCHEMA

STORED_DEFAULTS = ("quality", "frames_folder", "steps_per_second")
"""Settings that Blender does not save while nobody has touched them."""


def migrate(scene: bpy.types.Scene) -> str:
    """Bring a scene's environment to this version's schema; main thread only.

    Args:
        scene: Any scene; one without an environment is left alone.

    Returns:
        What was done, or why nothing can be; empty where there was nothing to do.
    """
    settings = scene.playable_environment
    if settings.root is None or settings.schema == SCHEMA or not scene.is_editable:
        return ""
    if settings.schema > SCHEMA:
        return settings.of_newer_addon()
    found = settings.schema
    for schema in range(max(found, 1), SCHEMA):
        _STEPS[schema](scene)
    settings.schema = SCHEMA
    return f"{scene.name!r} was made by an older version; it is up to date now"


def _bakes_start_from_states(scene: bpy.types.Scene) -> None:
    """Schema 1: bakes started from the picture, and failed without it; now from its state."""
    settings = scene.playable_environment
    for name in STORED_DEFAULTS:
        # What later versions take for granted must not change what this scene looks like.
        setattr(settings, name, getattr(settings, name))
    for each in scene.objects:
        if each.playable.is_playable and each.is_editable:
            each.playable.overrides.persist()
    if settings.bake_text is None:
        return
    try:
        content = bake_of(settings).to_json()
    except ShotError:
        return  # the same error greets whoever renders it, and the text stays as evidence
    settings.bake_text.from_string(content)


_STEPS: dict[int, Callable[[bpy.types.Scene], None]] = {1: _bakes_start_from_states}
"""By the schema that a step leads away from, to the next."""
