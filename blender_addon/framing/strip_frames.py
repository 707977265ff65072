"""The frame under a sequencer's playhead: the strip's own pixels, at its own size.

They are read from the strip's file, past the scene's resolution, view transform and effects. Only
where Blender stretches a movie in time does it have to render the frame itself, in a copy of the
scene whose colours are exact.
"""

import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from pe_runtime.contract.errors import ShotError

from ..filming.pixels import use_exact_colours
from ..pictures import pixels_of, read_picture
from ..strips.timing import span

PICTURED = ("IMAGE", "MOVIE")


@dataclass(frozen=True)
class StripFrame:
    """A frame of a strip.

    Attributes:
        scene: Scene with the sequencer.
        strip: Its strip, a movie's or of images.
        frame: Frame of the scene.
    """

    scene: bpy.types.Scene
    strip: bpy.types.ID
    frame: int

    @property
    def name(self) -> str:
        """What the picture may be called."""
        return f"{Path(self.strip.name).stem}_{self.frame:04d}"

    def pixels(self) -> np.ndarray:
        """(height, width, 3) uint8 sRGB, top row first.

        Raises:
            ShotError: The strip's file is gone or cannot be opened.
        """
        if self.strip.type == "IMAGE":
            return read_picture(self.file())
        return _movie_frame(self)

    def file(self) -> str:
        """Absolute path of the file that the frame is in."""
        strip = self.strip
        if strip.type == "MOVIE":
            return str(Path(bpy.path.abspath(strip.filepath)).resolve())
        element = strip.strip_elem_from_frame(self.frame) or strip.elements[0]
        return str((Path(bpy.path.abspath(strip.directory)) / element.filename).resolve())


def frame_under_playhead(scenes: Iterable[bpy.types.Scene | None]) -> StripFrame:
    """The strip's frame at the playhead of the first scene whose sequencer shows one.

    Raises:
        ShotError: None does.
    """
    looked = []
    for scene in scenes:
        if scene is None or scene.sequence_editor is None:
            continue
        looked.append(f"{scene.name!r} at frame {scene.frame_current}")
        if (strip := shown_strip(scene)) is not None:
            return StripFrame(scene, strip, scene.frame_current)
    where = " and ".join(dict.fromkeys(looked)) or "this file, which has no sequencer"
    raise ShotError(
        f"no movie or image strip is under the playhead in {where}; move the playhead onto one, or "
        "choose another kind of picture"
    )


def shown_strip(scene: bpy.types.Scene) -> bpy.types.ID | None:
    """The active movie or image strip if the playhead is on it, else the topmost one there."""
    editor = scene.sequence_editor
    here = list(_pictured(editor.strips, scene.frame_current))
    if editor.active_strip in here:
        return editor.active_strip
    return here[0] if here else None


def _pictured(strips: Iterable[bpy.types.ID], frame: int) -> Iterator[bpy.types.ID]:
    """Movie and image strips that show at a frame, topmost first, those in meta strips too."""
    for strip in sorted(strips, key=lambda each: each.channel, reverse=True):
        start, length = span(strip)
        if strip.mute or not start <= frame < start + length:
            continue
        if strip.type in PICTURED:
            yield strip
        elif strip.type == "META":
            yield from _pictured(strip.strips, frame)


def _movie_frame(wanted: StripFrame) -> np.ndarray:
    path = wanted.file()
    if not Path(path).is_file():
        raise ShotError(f"the movie {path!r} of strip {wanted.strip.name!r} is gone")
    try:
        movie = bpy.data.images.load(path, check_existing=False)
    except RuntimeError as error:
        raise ShotError(f"Blender cannot open the movie {path!r} ({error})") from error
    try:
        if movie.source != "MOVIE" or not movie.size[0]:
            raise ShotError(f"{path!r} is no movie that Blender can read")
        index = _frame_of_movie(wanted, movie.frame_duration)
        if index is None:
            return _rendered(wanted, tuple(movie.size))
        _turn_to(movie, index)
        return pixels_of(movie, path)
    finally:
        bpy.data.images.remove(movie)


def _frame_of_movie(wanted: StripFrame, movie_frames: int) -> int | None:
    """The movie's frame, from 0, that a strip shows; None where it is stretched in time."""
    strip = wanted.strip
    start, length, before, after = (getattr(strip, name) for name in _timing_names(strip))
    length = int(length)
    if length + before + after != movie_frames or len(getattr(strip, "retiming_keys", ())):
        return None
    index = min(max(wanted.frame - int(start), 0), length - 1)
    index = length - 1 - index if strip.use_reverse_frames else index
    return index - int(index % max(strip.strobe, 1)) + before


def _timing_names(strip: bpy.types.ID) -> tuple[str, str, str, str]:
    """What a movie strip calls the start and length of its content, and what is cut off it."""
    # Blender 5.2 renames them and warns about the old names.
    if "content_trim_start" in strip.bl_rna.properties:
        return "content_start", "content_duration", "content_trim_start", "content_trim_end"
    return "frame_start", "frame_duration", "animation_offset_start", "animation_offset_end"


def _turn_to(movie: bpy.types.Image, index: int) -> None:
    # Whoever looks at a movie last decides which frame `pixels` are of; a texture needs no window.
    texture = bpy.data.textures.new("playable frame", "IMAGE")
    try:
        texture.image = movie
        texture.image_user.use_auto_refresh = False
        texture.image_user.frame_current = index + 1
        texture.evaluate((0.0, 0.0, 0.0))
    finally:
        bpy.data.textures.remove(texture)


def _rendered(wanted: StripFrame, size: tuple[int, int]) -> np.ndarray:
    """What Blender renders of the strip alone, in a copy of its scene that is thrown away."""
    copy = wanted.scene.copy()
    try:
        strip = _alone(copy, wanted.strip)
        strip.blend_type, strip.blend_alpha = "REPLACE", 1.0
        strip.color_multiply = strip.color_saturation = 1.0
        for modifier in list(strip.modifiers):
            strip.modifiers.remove(modifier)
        _fill_frame(strip)
        render = copy.render
        render.resolution_x, render.resolution_y = size
        render.resolution_percentage = 100
        render.use_border = render.use_compositing = False
        render.use_sequencer, render.use_file_extension = True, True
        render.engine = "BLENDER_WORKBENCH"
        use_exact_colours(copy)
        _as_png(render.image_settings)
        copy.frame_set(wanted.frame)
        with tempfile.TemporaryDirectory() as folder:
            render.filepath = str(Path(folder) / "frame.png")
            bpy.ops.render.render(write_still=True, scene=copy.name)
            return read_picture(render.filepath)
    finally:
        bpy.data.scenes.remove(copy)


def _alone(scene: bpy.types.Scene, wanted: bpy.types.ID) -> bpy.types.ID:
    """The same strip in a copied scene, with every other one muted but those it lies in."""
    strips = scene.sequence_editor.strips_all
    for strip in strips:
        holds = strip.type == "META" and wanted.name in [each.name for each in strip.strips]
        strip.mute = strip.name != wanted.name and not holds
    return strips[wanted.name]


def _fill_frame(strip: bpy.types.ID) -> None:
    transform, crop = strip.transform, strip.crop
    transform.offset_x = transform.offset_y = transform.rotation = 0.0
    transform.scale_x = transform.scale_y = 1.0
    crop.min_x = crop.max_x = crop.min_y = crop.max_y = 0
    strip.use_flip_x = strip.use_flip_y = False


def _as_png(output: bpy.types.ImageFormatSettings) -> None:
    if hasattr(output, "media_type"):
        output.media_type = "IMAGE"
    output.file_format, output.color_mode, output.color_depth = "PNG", "RGB", "8"
    output.color_management = "FOLLOW_SCENE"
