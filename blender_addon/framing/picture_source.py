"""Where a new environment's picture comes from: a file, an Image, or a strip's frame."""

import hashlib
import re
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from pe_runtime.contract.errors import ShotError

from ..pictures import pixels_of, read_picture, write_picture
from .strip_frames import frame_under_playhead

FOLDER = "//playable"
"""Where pictures are kept that are in no file of their own."""
UNSAVED_FOLDER = Path(tempfile.gettempdir()) / "playable_environments"


@dataclass(frozen=True, eq=False)
class FoundPicture:
    """A picture that can be encoded.

    Attributes:
        pixels: (height, width, 3) uint8 sRGB, top row first.
        path: Absolute path of the file that holds these pixels, or will when it is kept.
        is_file: Whether it does already.
        note: What the artist should know of where it is kept.
    """

    pixels: np.ndarray
    path: str
    is_file: bool = True
    note: str = ""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.pixels.shape[1], self.pixels.shape[0]

    def keep(self) -> "FoundPicture":
        """Write the picture where there is no file of it yet; it and what is to be said of it.

        Raises:
            ShotError: It cannot be written anywhere.
        """
        if self.is_file or Path(self.path).is_file():
            return FoundPicture(self.pixels, self.path, True, self.note)
        elsewhere = UNSAVED_FOLDER / Path(self.path).name
        try:
            write_picture(Path(self.path), self.pixels)
            return FoundPicture(self.pixels, self.path, True, self.note)
        except OSError as error:
            refused = error
        try:
            write_picture(elsewhere, self.pixels)
        except OSError as error:
            raise ShotError(f"the picture cannot be kept in {elsewhere.parent}: {error}") from error
        note = f"the picture is kept in {elsewhere.parent}, since {refused}"
        return FoundPicture(self.pixels, str(elsewhere), True, note)


def find_picture(
    scene: bpy.types.Scene, edits: Iterable[bpy.types.Scene | None], path: str = ""
) -> FoundPicture:
    """The picture that a scene's settings name.

    Args:
        scene: With the settings.
        edits: Scenes whose sequencers are looked at, the likeliest first.
        path: A file that is taken instead.

    Raises:
        ShotError: There is no picture, and what to do about it.
    """
    settings = scene.playable_environment
    source = "FILE" if path else settings.framing.picture_source
    if source == "IMAGE":
        return _of_image(settings.framing.image)
    if source == "STRIP":
        shown = frame_under_playhead(edits)
        if shown.strip.type == "IMAGE":
            return FoundPicture(shown.pixels(), shown.file())
        return _to_keep(shown.name, shown.pixels())
    named = path or settings.image_path
    if not named:
        raise ShotError("no picture is chosen; name an image file in step 1, Picture")
    full = str(Path(bpy.path.abspath(named)).resolve())
    return FoundPicture(read_picture(full), full)


def _of_image(image: bpy.types.Image | None) -> FoundPicture:
    if image is None:
        raise ShotError("no Image is chosen; choose one in step 1, Picture")
    if image.type in ("RENDER_RESULT", "COMPOSITING"):
        raise ShotError(
            f"{image.name!r} is a viewer without pixels of its own; save it to a file and choose "
            "that"
        )
    if image.source in ("MOVIE", "SEQUENCE"):
        raise ShotError(
            f"{image.name!r} is many frames; put it into the sequencer and choose Strip, so that "
            "the playhead says which"
        )
    pixels = pixels_of(image, image.name)
    path = _file_of(image)
    if path and np.array_equal(read_picture(path), pixels):
        return FoundPicture(pixels, path)
    return _to_keep(image.name, pixels)


def _file_of(image: bpy.types.Image) -> str:
    """Path of the file that shows an Image's pixels; empty where there is none."""
    if image.source != "FILE" or image.packed_file or image.is_dirty or not image.filepath:
        return ""
    path = Path(bpy.path.abspath(image.filepath, library=image.library)).resolve()
    return str(path) if path.is_file() else ""


def _to_keep(name: str, pixels: np.ndarray) -> FoundPicture:
    # Named after its pixels: another frame of the same strip never takes an environment's picture.
    digest = hashlib.sha256(pixels.tobytes() + str(pixels.shape).encode()).hexdigest()[:12]
    clean = re.sub(r"[^\w.-]+", "_", Path(name).stem).strip("._") or "picture"
    file = f"{clean[:60]}_{digest}.png"
    if bpy.data.filepath:
        return FoundPicture(pixels, str(Path(bpy.path.abspath(FOLDER)).resolve() / file), False)
    note = f"this file is not saved yet, so its picture is kept in {UNSAVED_FOLDER}"
    return FoundPicture(pixels, str(UNSAVED_FOLDER / file), False, note)
