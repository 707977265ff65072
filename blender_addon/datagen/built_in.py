"""The scenes that come with the recorder, by name."""

from collections.abc import Callable
from functools import partial

from blender_addon.datagen.court import build_court
from blender_addon.datagen.duel import build_duel, build_duel_camera
from blender_addon.datagen.motion import FRAMES
from blender_addon.datagen.recordable import Recordable, keep_first_frames

_BUILDERS: dict[str, Callable[..., Recordable]] = {
    "duel": build_duel,
    "duel-camera": build_duel_camera,
    "court": build_court,
    "static-court": partial(build_court, static=True),
}


def build_scene(name: str, seed: int, sequence: int, frames: int | None = None) -> Recordable:
    """Empty Blender and build one sequence of a built-in scene in it.

    Args:
        name: One of the built-in scenes.
        seed: Of the data set.
        sequence: Number of the episode.
        frames: Of the episode; None for the usual 12. Up to that it is the usual episode's
            beginning, a longer one is another episode.
    """
    length = max(frames or FRAMES, FRAMES)
    source = _BUILDERS[name](seed, sequence, length)
    if frames is not None and frames < length:
        keep_first_frames(source, frames)
    return source
