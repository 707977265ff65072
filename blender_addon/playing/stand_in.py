"""Sampling a scene without touching it, in a small scene that stands in for it for a moment.

Going through the frames of the scene itself would put everything back to its keys that an artist
has moved but not keyed yet. A scene that no window shows is evaluated on copies only. It holds the
camera and the playable objects, so that a heavy set costs nothing; what they depend on comes along.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from ..scene_bridge import Moment, read_moment
from .stepping import playables_in

NAME = "Playable Environment sampling"
SHARED = (
    "fps",
    "fps_base",
    "resolution_x",
    "resolution_y",
    "resolution_percentage",
    "pixel_aspect_x",
    "pixel_aspect_y",
)


@contextmanager
def stand_in_for(scene: bpy.types.Scene) -> Iterator[bpy.types.Scene]:
    """A scene that samples like another one, gone again after the block; main thread only."""
    made = bpy.data.scenes.new(NAME)
    try:
        _furnish(made, scene)
        yield made
    finally:
        bpy.data.scenes.remove(made)


def moment_at(stand_in: bpy.types.Scene, frame: int) -> Moment:
    """What the scene asks for at a frame.

    Raises:
        PlayableEnvironmentError: It cannot be sampled, as for `read_moment`.
    """
    stand_in.frame_set(frame)
    return read_moment(stand_in.view_layers[0].depsgraph)


def _furnish(made: bpy.types.Scene, scene: bpy.types.Scene) -> None:
    made.playable_environment.stand_in_for = scene
    for name in SHARED:
        setattr(made.render, name, getattr(scene.render, name))
    made.camera = scene.camera
    for marker in scene.timeline_markers:
        made.timeline_markers.new(marker.name, frame=marker.frame).camera = marker.camera
    cameras = [marker.camera for marker in scene.timeline_markers]
    root = scene.playable_environment.root
    for each in dict.fromkeys((scene.camera, root, *cameras, *playables_in(scene))):
        if each is not None:
            made.collection.objects.link(each)
