"""A picture and words in a region of the window; needs a GPU context."""

import blf
import bpy
import gpu
import numpy as np
from bpy.app.translations import pgettext_iface as iface_
from gpu_extras.presets import draw_texture_2d

from ..filming.pixels import PassMemory
from ..wrapping import sentence, wrapped
from .view_camera import Rect

FONT = 0
FONT_SIZE = 13
MARGIN, LINE = 20, 18
"""Pixels at a user interface scale of 1."""
CHARACTER_WIDTH = 7.5
MOST_LINES = 8


def texture_of(rgb: np.ndarray) -> gpu.types.GPUTexture:
    """A scene-linear texture of sRGB bytes (height, width, 3), top row first."""
    height, width = rgb.shape[:2]
    numbers = PassMemory(width, height).combined(rgb)
    buffer = gpu.types.Buffer("FLOAT", len(numbers), numbers)
    return gpu.types.GPUTexture((width, height), format="RGBA16F", data=buffer)


def draw_texture(
    engine: bpy.types.RenderEngine,
    scene: bpy.types.Scene,
    texture: gpu.types.GPUTexture,
    rect: Rect,
    region_height: int,
) -> None:
    """Stretch a texture over a part of a region, in the scene's display space."""
    bottom = region_height - rect.top - rect.height
    gpu.state.blend_set("NONE")
    engine.bind_display_space_shader(scene)
    draw_texture_2d(texture, (rect.left, bottom), rect.width, rect.height)
    engine.unbind_display_space_shader()


def draw_words(words: str, region_width: int, scale: float, bottom: int = 0) -> None:
    """Write a message into the lower left corner of a region.

    Args:
        words: What is to be read.
        region_width: Pixels.
        scale: Of the user interface.
        bottom: Pixels at the lower border that something else covers.
    """
    columns = max(int((region_width - 2 * MARGIN * scale) / (CHARACTER_WIDTH * scale)), 20)
    blf.size(FONT, FONT_SIZE * scale)
    blf.color(FONT, 1.0, 1.0, 1.0, 1.0)
    blf.enable(FONT, blf.SHADOW)
    blf.shadow(FONT, 5, 0.0, 0.0, 0.0, 1.0)
    kept = wrapped(sentence(iface_(words)), columns)[:MOST_LINES]
    for index, line in enumerate(kept):
        height = MARGIN + LINE * (len(kept) - 1 - index)
        blf.position(FONT, MARGIN * scale, bottom + height * scale, 0.0)
        blf.draw(FONT, line)
    blf.disable(FONT, blf.SHADOW)
