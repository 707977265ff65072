"""Rendered frames as one image strip, in a scene of its own.

The strip stands in "<scene> Edit" and not in the scene that is rendered: a scene whose sequencer
holds a strip renders the strip, and its engine is never asked again.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy

from pe_runtime.contract.errors import ShotError

from .pixels import use_exact_colours

JOB_KEY = "playable_environment_job"
LAST_CHANNEL = 128


@dataclass(frozen=True)
class StripPlan:
    """What a strip should show.

    Attributes:
        job: Names the strip across repetitions and renames.
        name: Shown on the strip when it is new.
        files: One picture per frame, all in one folder.
        frame_start: Timeline frame of the first picture.
    """

    job: str
    name: str
    files: Sequence[Path]
    frame_start: int

    @property
    def frame_end(self) -> int:
        """First timeline frame after the strip."""
        return self.frame_start + len(self.files)


def edit_scene_for(scene: bpy.types.Scene) -> bpy.types.Scene:
    """The scene that holds a scene's strip, made on first use, with its size, pace and range."""
    settings = scene.playable_environment
    edit = settings.edit_scene
    if edit is None:
        edit = settings.edit_scene = bpy.data.scenes.new(f"{scene.name} Edit")
    source, target = scene.render, edit.render
    for name in ("resolution_x", "resolution_y", "resolution_percentage", "fps", "fps_base"):
        setattr(target, name, getattr(source, name))
    for name in ("pixel_aspect_x", "pixel_aspect_y"):
        setattr(target, name, getattr(source, name))
    edit.frame_start, edit.frame_end = scene.frame_start, scene.frame_end
    if edit.sequence_editor is None:
        edit.sequence_editor_create()
    use_exact_colours(edit)
    return edit


def place_strip(edit: bpy.types.Scene, plan: StripPlan) -> bpy.types.Strip:
    """Put the frames on a free channel, or into the strip that this job already has.

    Raises:
        ShotError: A file is missing, or all channels are taken.
    """
    missing = [file for file in plan.files if not file.is_file()]
    if missing or not plan.files:
        raise ShotError(
            f"{len(missing)} of {len(plan.files)} rendered frames are missing, first "
            f"{missing[0] if missing else 'none was rendered'}; render the range again"
        )
    strips = edit.sequence_editor.strips
    strip = next((each for each in strips if each.get(JOB_KEY) == plan.job), None)
    if strip is None:
        strip = strips.new_image(
            name=plan.name,
            filepath=str(plan.files[0]),
            channel=_free_channel(strips, plan.frame_start, plan.frame_end),
            frame_start=plan.frame_start,
            fit_method="ORIGINAL",
        )
        strip[JOB_KEY] = plan.job
    _fill(strip, plan)
    return strip


def span(strip: bpy.types.Strip) -> tuple[int, int]:
    """The first timeline frame that a strip covers, and how many it covers."""
    if _has_new_names(strip):
        return strip.left_handle, strip.duration
    return strip.frame_final_start, strip.frame_final_duration


def _free_channel(strips: Iterable[bpy.types.Strip], start: int, end: int) -> int:
    spans = [(each.channel, *span(each)) for each in strips]
    taken = {channel for channel, first, frames in spans if first < end and first + frames > start}
    for channel in range(1, LAST_CHANNEL + 1):
        if channel not in taken:
            return channel
    raise ShotError(
        f"all {LAST_CHANNEL} channels are taken from frame {start} to {end}; clear one of them"
    )


def _fill(strip: bpy.types.Strip, plan: StripPlan) -> None:
    folder = str(plan.files[0].parent)
    strip.directory = bpy.path.relpath(folder) if bpy.data.filepath else folder
    while len(strip.elements) > 1:
        strip.elements.pop(len(strip.elements) - 1)
    strip.elements[0].filename = plan.files[0].name
    for file in plan.files[1:]:
        strip.elements.append(file.name)
    _set_range(strip, plan.frame_start, len(plan.files))
    strip.colorspace_settings.name = "sRGB"
    # Blender keeps showing the pixels of the files that were replaced unless it is told.
    strip.invalidate_cache("RAW")


def _has_new_names(strip: bpy.types.Strip) -> bool:
    # Blender 5.2 renames a strip's handles and warns about the old names.
    return "content_start" in strip.bl_rna.properties


def _set_range(strip: bpy.types.Strip, start: int, length: int) -> None:
    if _has_new_names(strip):
        strip.left_handle_offset = strip.right_handle_offset = 0
        strip.content_start, strip.duration = start, length
    else:
        strip.frame_offset_start = strip.frame_offset_end = 0
        strip.frame_start, strip.frame_final_duration = start, length


def write_video(edit: bpy.types.Scene, path: Path) -> None:
    """Render a scene's sequencer to an mp4 that common players show.

    Raises:
        ShotError: The size is odd, which H.264 in players' usual form cannot hold.
    """
    render, output = edit.render, edit.render.image_settings
    width = render.resolution_x * render.resolution_percentage // 100
    height = render.resolution_y * render.resolution_percentage // 100
    if width % 2 or height % 2:
        raise ShotError(f"the video would be {width}x{height} pixels; make both numbers even")
    if hasattr(output, "media_type"):
        output.media_type = "VIDEO"
    output.file_format = "FFMPEG"
    render.ffmpeg.format, render.ffmpeg.codec = "MPEG4", "H264"
    render.ffmpeg.audio_codec, render.ffmpeg.constant_rate_factor = "NONE", "HIGH"
    render.filepath, render.use_sequencer = str(path), True
    bpy.ops.render.render(animation=True, scene=edit.name)
