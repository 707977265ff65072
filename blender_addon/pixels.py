"""Pixels on their way from the worker into Blender and out to a file, without changing a byte.

Blender wants scene-linear rows from the bottom up and applies the scene's view transform when it
saves. With `use_exact_colours` the two steps cancel and the PNG holds the worker's own bytes.
"""

import numpy as np

# What Blender's own engines write where a ray meets nothing; infinity breaks compositor nodes.
FAR_AWAY = np.float32(1e10)
EXACT_VIEW = {
    "view_transform": "Standard",
    "look": "None",
    "exposure": 0.0,
    "gamma": 1.0,
    "use_curve_mapping": False,
}


def _linear_of_bytes() -> np.ndarray:
    # In float64, rounded once: Blender's way back to bytes then meets every value exactly.
    encoded = np.arange(256, dtype=np.float64) / 255
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return linear.astype(np.float32)


LINEAR_OF_BYTE = _linear_of_bytes()


def combined_from_srgb(rgb: np.ndarray) -> np.ndarray:
    """Scene-linear float32 RGBA of opaque sRGB bytes; (height, width, 3) in, 4 channels out."""
    rgba = np.ones((*rgb.shape[:2], 4), np.float32)
    rgba[..., :3] = LINEAR_OF_BYTE[rgb]
    return rgba


def depth_for_blender(depth: np.ndarray, metres_per_unit: float = 1.0) -> np.ndarray:
    """Depth as Blender's engines write it: nothing is `FAR_AWAY` instead of +inf.

    Args:
        depth: (height, width) planar z in environment metres.
        metres_per_unit: Scale of the environment root.
    """
    scaled = depth.astype(np.float32) * np.float32(metres_per_unit)
    return np.where(np.isfinite(scaled), scaled, FAR_AWAY).astype(np.float32)


def bottom_up(image: np.ndarray, left: int, bottom: int, width: int, height: int) -> np.ndarray:
    """A window of a picture, its rows from the bottom up and flat, as a render pass takes them.

    Args:
        image: (rows, columns) or (rows, columns, channels), top row first.
        left: First column of the window.
        bottom: First row of the window, counted from the bottom.
        width: Columns of the window.
        height: Rows of the window.
    """
    window = image[::-1][bottom : bottom + height, left : left + width]
    # A copy in this machine's own float32: Blender refuses arrays that spell out "<f4".
    return window.astype(np.float32, order="C").ravel()


def use_exact_colours(scene: object) -> None:
    """Set a scene's colour management so that rendered sRGB bytes are saved unchanged."""
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
    found = {name: getattr(view, name) for name in EXACT_VIEW}
    changes = [
        f"{name} is {found[name]!r} instead of {value!r}"
        for name, value in EXACT_VIEW.items()
        if found[name] != value
    ]
    if getattr(view, "use_white_balance", False):
        changes.append("white balance is on")
    if display != "sRGB":
        changes.append(f"display is {display!r} instead of 'sRGB'")
    if scene.render.dither_intensity > 0:
        changes.append(f"dither is {scene.render.dither_intensity:g} instead of 0")
    return changes
