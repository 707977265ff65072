"""Pictures that Blender can open, as the sRGB bytes that the worker encodes."""

from pathlib import Path

import bpy
import numpy as np

from pe_runtime.contract.errors import ShotError


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
        return _bytes_of(image, path)
    finally:
        bpy.data.images.remove(image)


def _bytes_of(image: bpy.types.Image, path: str) -> np.ndarray:
    width, height = image.size
    if not width * height:
        raise ShotError(f"{path!r} holds no picture that Blender understands")
    flat = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(flat)
    values = flat.reshape(height, width, image.channels)[::-1]
    rgb = values[..., :3] if image.channels >= 3 else np.repeat(values[..., :1], 3, axis=2)
    if not np.isfinite(rgb).all():
        raise ShotError(f"{path!r} holds NaN or infinite pixels; save it again as an 8-bit PNG")
    # Byte images keep their encoding in `pixels`; float ones are scene-linear.
    encoded = _srgb_from_linear(rgb) if image.is_float else rgb
    return np.rint(np.clip(encoded, 0.0, 1.0) * 255).astype(np.uint8)


def _srgb_from_linear(linear: np.ndarray) -> np.ndarray:
    positive = np.maximum(linear, 0.0)
    return np.where(positive <= 0.0031308, positive * 12.92, 1.055 * positive ** (1 / 2.4) - 0.055)
