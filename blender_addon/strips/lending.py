"""Render settings that a job borrows from its scene, and how they always come back.

What was there before is noted in the scene itself for as long as it is lent. So it comes back
whatever happens: from an undo step that was taken meanwhile, from a file that was saved meanwhile,
after a crash. The note names no scene, so a renamed scene gets its own settings back too.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
from bpy.app.handlers import persistent

from ..filming.pixels import TELLTALES, use_equal_files
from ..scene_bridge import ENGINE, picture_only
from .job import DIGITS, PREFIX, RangeJob

NOTE_KEY = "playable_environment_lent"
_LENT = (
    "engine",
    "filepath",
    "use_sequencer",
    "use_overwrite",
    "use_placeholder",
    "use_file_extension",
)
_LENT_FORMAT = ("file_format", "color_mode", "color_depth", "compression", "color_management")
_out: set[str] = set()
"""Names of the scenes whose settings are lent just now."""


@contextmanager
def lent_settings(
    scene: bpy.types.Scene, job: RangeJob, folder: Path | None = None
) -> Iterator[None]:
    """Render settings that write the job's files, for as long as the block runs.

    Args:
        scene: The job's scene.
        job: Whose frames are written.
        folder: Where to; None for the job's own folder.
    """
    name = scene.name
    try:
        _lend(scene, job, folder or job.folder)
        yield
    finally:
        picture_only.discard(name)
        _out.discard(name)
        give_back_all()


def give_back_all() -> None:
    """Put back what is noted in any scene, unless it is lent just now; main thread only."""
    for scene in bpy.data.scenes:
        if NOTE_KEY in scene and not _out:
            _give_back(scene)


def is_lent(scene: bpy.types.Scene) -> bool:
    """Whether the scene's settings are not the artist's own at the moment."""
    return NOTE_KEY in scene


def composites(scene: bpy.types.Scene) -> bool:
    """Whether compositor nodes see the passes."""
    if not scene.render.use_compositing:
        return False
    # Since 5.0 a scene names its nodes; before, it had some or had none.
    if "compositing_node_group" in scene.bl_rna.properties:
        return scene.compositing_node_group is not None
    return scene.use_nodes


def _lend(scene: bpy.types.Scene, job: RangeJob, folder: Path) -> None:
    if NOTE_KEY in scene:
        _give_back(scene)
    scene[NOTE_KEY] = json.dumps(_kept(scene))
    _out.add(scene.name)
    render, output = scene.render, scene.render.image_settings
    render.engine, render.use_sequencer = ENGINE, False
    render.filepath = str(folder / (PREFIX + "#" * DIGITS))
    render.use_overwrite, render.use_placeholder = True, False
    render.use_file_extension = True
    if hasattr(output, "media_type"):
        output.media_type = "IMAGE"
    output.file_format, output.color_mode, output.color_depth = "PNG", "RGB", "8"
    output.color_management = "FOLLOW_SCENE"
    use_equal_files(render)
    scene.frame_start, scene.frame_end = job.frame_start, job.frame_end
    # Each pass costs as much as the picture or more, and a PNG holds none.
    if not composites(scene):
        picture_only.add(scene.name)


def _kept(scene: bpy.types.Scene) -> dict:
    render, output = scene.render, scene.render.image_settings
    # In the order in which they have to be put back: a media type decides the formats.
    formats = (("media_type",) if hasattr(output, "media_type") else ()) + _LENT_FORMAT
    return {
        "format": {name: getattr(output, name) for name in formats},
        "render": {name: getattr(render, name) for name in (*_LENT, *TELLTALES)},
        "range": {name: getattr(scene, name) for name in ("frame_start", "frame_end")},
    }


def _give_back(scene: bpy.types.Scene) -> None:
    note = json.loads(scene[NOTE_KEY])
    places = {"format": scene.render.image_settings, "render": scene.render, "range": scene}
    for place, values in note.items():
        for name, value in values.items():
            setattr(places[place], name, value)
    del scene[NOTE_KEY]


@persistent
def _after_change(*_: object) -> None:
    """A file or an undo step may come from the time when settings were lent."""
    give_back_all()


_HANDLERS = ("undo_post", "redo_post", "load_post")


def register() -> None:
    """Watch for files and undo steps from the time when settings were lent."""
    for name in _HANDLERS:
        getattr(bpy.app.handlers, name).append(_after_change)


def unregister() -> None:
    """Undo `register`."""
    for name in _HANDLERS:
        getattr(bpy.app.handlers, name).remove(_after_change)
