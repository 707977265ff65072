"""Pixels on their way from the worker into Blender and out to a file, without changing a byte.

Blender wants scene-linear rows from the bottom up and applies the scene's view transform when it
saves. With `use_exact_colours` the two steps cancel and the PNG holds the worker's own bytes.
"""

from functools import lru_cache

import numpy as np

# What Blender's own engines write where a ray meets nothing; infinity breaks compositor nodes.
FAR_AWAY = np.float32(1e10)
TELLTALES = (
    "use_stamp_date",
    "use_stamp_render_time",
    "use_stamp_frame_range",
    "use_stamp_memory",
    "use_stamp_hostname",
)
"""What Blender notes in a file and what is another at every run."""
EXACT_VIEW = {
    "view_transform": "Standard",
    "look": "None",
    "exposure": 0.0,
    "gamma": 1.0,
    "use_curve_mapping": False,
}
VIEW_LABELS = {
    "view_transform": "View Transform",
    "look": "Look",
    "exposure": "Exposure",
    "gamma": "Gamma",
    "use_curve_mapping": "Use Curves",
}


def _linear_of_bytes() -> np.ndarray:
    # In float64, rounded once: Blender's way back to bytes then meets every value exactly.
    encoded = np.arange(256, dtype=np.float64) / 255
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return linear.astype(np.float32)


def _linear_of_pairs() -> np.ndarray:
    # Two bytes at a time: half as many look-ups, and each a move of eight bytes.
    bytes_of_pair = np.arange(1 << 16, dtype=np.uint16).view(np.uint8).reshape(-1, 2)
    return _linear_of_bytes()[bytes_of_pair].view(np.float64)[:, 0]


_LINEAR_OF_PAIR = _linear_of_pairs()


class PassMemory:
    """Where pictures become the numbers of render passes, one after the other.

    Every result is flat float32 in the same memory, rows from the bottom up: hand it over before
    asking for the next. Fresh memory for each frame would cost more than the conversion.

    Args:
        width: Columns of the pictures.
        height: Rows of the pictures.
    """

    def __init__(self, width: int, height: int) -> None:
        self._opaque = np.full((height, width, 4), 255, np.uint8)
        self._pairs = np.empty((height, width * 2), np.float64)

    def combined(self, rgb: np.ndarray) -> np.ndarray:
        """Scene-linear RGBA of opaque sRGB bytes (height, width, 3), top row first."""
        for channel in range(3):
            self._opaque[..., channel] = rgb[::-1, :, channel]
        pairs = self._opaque.reshape(len(self._opaque), -1).view(np.uint16)
        # No pair of bytes is out of range: "clip" only spares the look.
        _LINEAR_OF_PAIR.take(pairs, mode="clip", out=self._pairs)
        return self._pairs.ravel().view(np.float32)

    def layer(self, rgba: np.ndarray) -> np.ndarray:
        """Scene-linear RGBA, multiplied by its alpha, of sRGB bytes with straight alpha.

        Args:
            rgba: (height, width, 4) uint8, top row first.
        """
        numbers = self.combined(rgba[..., :3])
        colours = numbers.reshape(*self._opaque.shape)
        colours[..., 3] = rgba[::-1, :, 3]
        colours[..., 3] /= np.float32(255)
        colours[..., :3] *= colours[..., 3:]
        return numbers

    def values(self, image: np.ndarray) -> np.ndarray:
        """Numbers (height, width), top row first, unchanged."""
        return self._copied(image)

    def depth(self, depth: np.ndarray, metres_per_unit: float) -> np.ndarray:
        """Depth as Blender's engines write it: nothing is `FAR_AWAY` instead of +inf.

        Args:
            depth: (height, width) planar z in environment metres, top row first.
            metres_per_unit: Scale of the environment root.
        """
        numbers = self._copied(depth)
        numbers *= np.float32(metres_per_unit)
        numbers[~np.isfinite(numbers)] = FAR_AWAY
        return numbers

    def _copied(self, image: np.ndarray) -> np.ndarray:
        numbers = self._pairs.ravel().view(np.float32)[: image.size]
        numbers.reshape(image.shape)[:] = image[::-1]
        return numbers


@lru_cache(maxsize=2)
def memory_for(width: int, height: int) -> PassMemory:
    """The memory for passes of a size, kept from frame to frame."""
    return PassMemory(width, height)


def use_equal_files(render: object) -> None:
    """Keep out of rendered files what Blender would note of the run: equal pixels, equal bytes."""
    for name in () if render.use_stamp else TELLTALES:
        setattr(render, name, False)


def use_exact_colours(scene: object) -> None:
    """Set a scene's colour management so that rendered sRGB bytes are saved unchanged."""
    scene.render.image_settings.color_management = "FOLLOW_SCENE"
    scene.display_settings.display_device = "sRGB"
    for name, value in EXACT_VIEW.items():
        setattr(scene.view_settings, name, value)
    if hasattr(scene.view_settings, "use_white_balance"):
        scene.view_settings.use_white_balance = False
    scene.render.dither_intensity = 0.0
    scene.sequencer_colorspace_settings.name = "sRGB"


def colour_changes(scene: object) -> list[str]:
    """The settings by which a scene would save other bytes than were rendered; empty if none."""
    output = scene.render.image_settings
    if output.file_format in ("OPEN_EXR", "OPEN_EXR_MULTILAYER"):
        return []
    overridden = output.color_management == "OVERRIDE"
    place = output if overridden else scene
    view, display = place.view_settings, place.display_settings.display_device
    changes = [
        f"{VIEW_LABELS[name]} is {_shown(getattr(view, name))}, not {_shown(value)}"
        for name, value in EXACT_VIEW.items()
        if getattr(view, name) != value
    ]
    if getattr(view, "use_white_balance", False):
        changes.append("White Balance is on")
    if display != "sRGB":
        changes.append(f"Display Device is {display}, not sRGB")
    if scene.render.dither_intensity > 0:
        changes.append(f"Dither is {scene.render.dither_intensity:g}, not 0")
    return changes


def _shown(value: object) -> str:
    """A setting as Blender's panels show it."""
    if isinstance(value, bool):
        return "on" if value else "off"
    return value if isinstance(value, str) else f"{value:g}"
