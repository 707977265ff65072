"""Pictures that Blender can open, as the sRGB bytes that the worker encodes, and back to files."""

import zlib
from pathlib import Path

import bpy
import numpy as np

from pe_runtime.contract.errors import ShotError

from .complete_files import write_complete

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
EIGHT_BIT_RGB = bytes((8, 2, 0, 0, 0))


def read_picture(path: str) -> np.ndarray:
    """Read a picture; (height, width, 3) uint8 sRGB, top row first.

    Raises:
        ShotError: There is no such file, or it is no picture.
    """
    if not Path(path).is_file():
        raise ShotError(f"there is no picture {path!r}; choose an image file")
    try:
        image = bpy.data.images.load(path, check_existing=False)
    except RuntimeError as error:
        raise ShotError(f"Blender cannot open {path!r} ({error})") from error
    try:
        return pixels_of(image, path)
    finally:
        bpy.data.images.remove(image)


def pixels_of(image: bpy.types.Image, where: str) -> np.ndarray:
    """What an Image shows; (height, width, 3) uint8 sRGB, top row first.

    Args:
        image: Its pixels may have been painted, packed or generated.
        where: Names it in messages.

    Raises:
        ShotError: It has no pixels, or some that are no colours.
    """
    width, height = image.size
    if not width * height:
        raise ShotError(f"{where!r} holds no picture that Blender understands")
    flat = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(flat)
    values = flat.reshape(height, width, image.channels)[::-1]
    rgb = values[..., :3] if image.channels >= 3 else np.repeat(values[..., :1], 3, axis=2)
    if not np.isfinite(rgb).all():
        raise ShotError(f"{where!r} holds NaN or infinite pixels; save it again as an 8-bit PNG")
    # Byte images keep their encoding in `pixels`; float ones are scene-linear.
    encoded = _srgb_from_linear(rgb) if image.is_float else rgb
    return np.rint(np.clip(encoded, 0.0, 1.0) * 255).astype(np.uint8)


def write_picture(path: Path, pixels: np.ndarray) -> None:
    """Write (height, width, 3) uint8 sRGB as a PNG, whole or not at all.

    Raises:
        OSError: The folder or the file cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    write_complete(path, png_bytes(pixels))


def png_bytes(pixels: np.ndarray) -> bytes:
    """The PNG file of (height, width, 3) uint8 sRGB; the same bytes for the same pixels."""
    # By hand, since Blender saves only what is an Image, and through its colour management.
    height, width, _ = pixels.shape
    rows = pixels.reshape(height, width * 3)
    unfiltered = np.concatenate([np.zeros((height, 1), np.uint8), rows], axis=1)
    size = width.to_bytes(4, "big") + height.to_bytes(4, "big")
    parts = (
        (b"IHDR", size + EIGHT_BIT_RGB),
        (b"sRGB", b"\0"),
        (b"IDAT", zlib.compress(unfiltered.tobytes(), 6)),
        (b"IEND", b""),
    )
    return PNG_SIGNATURE + b"".join(_png_part(kind, content) for kind, content in parts)


def _png_part(kind: bytes, content: bytes) -> bytes:
    check = zlib.crc32(kind + content).to_bytes(4, "big")
    return len(content).to_bytes(4, "big") + kind + content + check


def _srgb_from_linear(linear: np.ndarray) -> np.ndarray:
    positive = np.maximum(linear, 0.0)
    return np.where(positive <= 0.0031308, positive * 12.92, 1.055 * positive ** (1 / 2.4) - 0.055)
