"""Whether frames of Blender's own Render Animation reach the disk whole.

Blender calls a file a success that a full disk has cut off, and renders on. So there has to be room
before a frame is drawn, and what was cut off is deleted and stops the range. The handlers may run
off the main thread: they touch files, and of Blender they only read.
"""

import shutil
import sys
from pathlib import Path

import bpy
from bpy.app.handlers import persistent

from pe_runtime.contract.errors import ShotError

from ..scene_bridge import ENGINE
from ..strips.lending import is_lent

ENDINGS = {
    ".png": b"IEND\xaeB`\x82",
    ".jpg": b"\xff\xd9",
    ".jpeg": b"\xff\xd9",
}
"""How a whole file ends, where that tells."""
BYTES_PER_CHANNEL = 4
SPARE_BYTES = 1 << 20
_cut: dict[str, str] = {}
"""By the scene's name, why its range must not go on."""


def check_room(scene: bpy.types.Scene, pixels: int, channels: int) -> None:
    """Make sure that the last frame arrived and that the next one can.

    Args:
        scene: Renders an animation.
        pixels: Of a frame.
        channels: Of all its passes together.

    Raises:
        ShotError: A frame was cut off, or the disk cannot hold another one.
    """
    if (reason := _cut.get(scene.name)) is not None:
        raise ShotError(reason)
    if scene.render.is_movie_format or is_lent(scene):
        return
    folder = _nearest_folder(_file_of(scene))
    needed = pixels * channels * BYTES_PER_CHANNEL + SPARE_BYTES
    if folder is not None and (free := shutil.disk_usage(folder).free) < needed:
        raise ShotError(
            f"the disk of {folder} has {free >> 20} MB left and a frame may take "
            f"{needed >> 20} MB; free some space and render again, finished frames are kept"
        )


def cut_off(path: Path) -> bool:
    """Whether a picture's file was begun and not finished, as far as its ending tells."""
    try:
        size = path.stat().st_size
        ending = ENDINGS.get(path.suffix.lower(), b"")
        with path.open("rb") as file:
            file.seek(max(size - len(ending), 0))
            return size == 0 or file.read() != ending
    except OSError:
        return False  # nothing was begun, or nobody may look


def _file_of(scene: bpy.types.Scene) -> Path:
    return Path(bpy.path.abspath(scene.render.frame_path(frame=scene.frame_current)))


def _nearest_folder(path: Path) -> Path | None:
    return next((each for each in path.parents if each.is_dir()), None)


@persistent
def _begin(scene: bpy.types.Scene, *_: object) -> None:
    _cut.pop(scene.name, None)


@persistent
def _check(scene: bpy.types.Scene, *_: object) -> None:
    render = scene.render
    if render.engine != ENGINE or render.is_movie_format or is_lent(scene):
        return
    path = _file_of(scene)
    if cut_off(path):
        path.unlink(missing_ok=True)
        _cut[scene.name] = (
            f"{path} was not written whole; the disk may be full: free some space and render "
            "again, finished frames are kept"
        )
        # Of the last frame of a range nobody else tells.
        sys.stderr.write(f"Error: Playable Environment: {_cut[scene.name]}\n")


def register() -> None:
    """Watch the files that Blender writes."""
    bpy.app.handlers.render_init.append(_begin)
    bpy.app.handlers.render_write.append(_check)


def unregister() -> None:
    """Undo `register`."""
    bpy.app.handlers.render_init.remove(_begin)
    bpy.app.handlers.render_write.remove(_check)
