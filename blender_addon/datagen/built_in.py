"""The scenes that come with the recorder, by name."""

from collections.abc import Callable
from functools import partial

from blender_addon.datagen.court import build_court
from blender_addon.datagen.duel import build_duel, build_duel_camera
from blender_addon.datagen.recordable import Recordable

_BUILDERS: dict[str, Callable[[int, int], Recordable]] = {
    "duel": build_duel,
    "duel-camera": build_duel_camera,
    "court": build_court,
    "static-court": partial(build_court, static=True),
}


def build_scene(name: str, seed: int, sequence: int) -> Recordable:
    """Empty Blender and build one sequence of a built-in scene in it."""
    return _BUILDERS[name](seed, sequence)
