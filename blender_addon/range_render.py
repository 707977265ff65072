"""Rendering a scene's range to numbered PNG files, then showing them in the sequencer.

The render settings that this needs are lent to it and given back, whatever happens.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy

from pe_runtime.contract.errors import ShotError

from .scene_bridge import picture_only
from .sequencer import StripPlan, edit_scene_for, place_strip

DIGITS = 4
PREFIX = "frame_"
_LENT = (
    "engine",
    "filepath",
    "use_sequencer",
    "use_overwrite",
    "use_placeholder",
    "use_file_extension",
)
_LENT_FORMAT = ("file_format", "color_mode", "color_depth", "compression", "color_management")


@dataclass(frozen=True)
class RangeJob:
    """One range of frames on its way to disk.

    Attributes:
        scene_name: Name and not the scene: undo and loading invalidate references.
        folder: Where the PNG files go.
        frame_start: First frame.
        frame_end: Last frame, inclusive.
    """

    scene_name: str
    folder: Path
    frame_start: int
    frame_end: int

    @property
    def files(self) -> list[Path]:
        """The pictures in order."""
        frames = range(self.frame_start, self.frame_end + 1)
        return [self.folder / f"{PREFIX}{frame:0{DIGITS}d}.png" for frame in frames]


def job_for(scene: bpy.types.Scene, folder: str) -> RangeJob:
    """The job that renders a scene's frame range into a folder.

    Raises:
        ShotError: The folder is relative to a .blend that was never saved, or frames are skipped.
    """
    if not folder or (folder.startswith("//") and not bpy.data.filepath):
        raise ShotError(
            f"the frames folder {folder!r} is relative to a file that is not saved yet; save the "
            ".blend or choose an absolute folder"
        )
    if scene.frame_step != 1:
        raise ShotError(
            f"the scene renders every {scene.frame_step}th frame, which a strip would play too "
            "fast; set the frame step to 1"
        )
    absolute = Path(bpy.path.abspath(folder)).resolve()
    return RangeJob(scene.name, absolute, scene.frame_start, scene.frame_end)


@contextmanager
def lent_settings(scene: bpy.types.Scene, job: RangeJob) -> Iterator[None]:
    """Render settings that write the job's files, for as long as the block runs."""
    take, give_back = borrow_settings(scene, job)
    try:
        take()
        yield
    finally:
        give_back()


def borrow_settings(scene: bpy.types.Scene, job: RangeJob) -> tuple:
    """Two functions: one sets what the job needs, the other puts back what was there before."""
    render, output = scene.render, scene.render.image_settings
    has_media_type = hasattr(output, "media_type")
    media_type = output.media_type if has_media_type else None
    kept = {name: getattr(render, name) for name in _LENT}
    kept_format = {name: getattr(output, name) for name in _LENT_FORMAT}

    def take() -> None:
        render.engine, render.use_sequencer = "PLAYABLE_ENV", False
        render.filepath = str(job.folder / (PREFIX + "#" * DIGITS))
        render.use_overwrite, render.use_placeholder = True, False
        render.use_file_extension = True
        if has_media_type:
            output.media_type = "IMAGE"
        output.file_format, output.color_mode, output.color_depth = "PNG", "RGB", "8"
        output.color_management = "FOLLOW_SCENE"
        # Each pass costs as much as the picture or more, and a PNG holds none.
        if not _composites(scene):
            picture_only.add(job.scene_name)

    def give_back() -> None:
        picture_only.discard(job.scene_name)
        if has_media_type:
            output.media_type = media_type
        for name, value in kept_format.items():
            setattr(output, name, value)
        for name, value in kept.items():
            setattr(render, name, value)

    return take, give_back


def _composites(scene: bpy.types.Scene) -> bool:
    """Whether compositor nodes see the passes."""
    if not scene.render.use_compositing:
        return False
    # Since 5.0 a scene names its nodes; before, it had some or had none.
    if "compositing_node_group" in scene.bl_rna.properties:
        return scene.compositing_node_group is not None
    return scene.use_nodes


def show_in_sequencer(scene: bpy.types.Scene, job: RangeJob) -> bpy.types.Strip:
    """Put a finished job's files into the scene's strip in its Edit scene; main thread only."""
    edit = edit_scene_for(scene)
    settings = scene.playable_environment
    plan = StripPlan(settings.job or scene.name, scene.name, job.files, job.frame_start)
    return place_strip(edit, plan)


class RenderWatch:
    """Sees what Blender's render job does, through handlers that only set numbers.

    Blender calls the handlers off the main thread, so nothing of Blender is touched in them.

    Attributes:
        written: Frames saved so far.
        ended: Whether the job is over.
        cancelled: Whether it ended early.
    """

    def __init__(self) -> None:
        self.written, self.ended, self.cancelled = 0, False, False
        handlers = bpy.app.handlers
        self._pairs = (
            (handlers.render_write, self._on_write),
            (handlers.render_complete, self._on_complete),
            (handlers.render_cancel, self._on_cancel),
        )
        for place, handler in self._pairs:
            place.append(handler)

    def close(self) -> None:
        """Stop watching."""
        for place, handler in self._pairs:
            place.remove(handler)

    def _on_write(self, *_: object) -> None:
        self.written += 1

    def _on_complete(self, *_: object) -> None:
        self.ended = True

    def _on_cancel(self, *_: object) -> None:
        self.ended = self.cancelled = True
