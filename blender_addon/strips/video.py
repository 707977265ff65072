"""The cut as a video."""

from pathlib import Path

import bpy

from pe_runtime.contract.errors import ShotError

from .wish import full_size


def write_video(edit: bpy.types.Scene, path: Path) -> None:
    """Render a scene's sequencer to an mp4 that common players show.

    Raises:
        ShotError: The size is odd, which H.264 in players' usual form cannot hold.
    """
    render, output = edit.render, edit.render.image_settings
    width, height = full_size(edit)
    if width % 2 or height % 2:
        raise ShotError(f"the video would be {width}x{height} pixels; make both numbers even")
    if hasattr(output, "media_type"):
        output.media_type = "VIDEO"
    output.file_format = "FFMPEG"
    render.ffmpeg.format, render.ffmpeg.codec = "MPEG4", "H264"
    render.ffmpeg.audio_codec, render.ffmpeg.constant_rate_factor = "NONE", "HIGH"
    render.filepath, render.use_sequencer = str(path), True
    bpy.ops.render.render(animation=True, scene=edit.name)
