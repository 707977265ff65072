"""Render one picture with its id and depth, exactly: no noise, nothing blended into the ids.

Cycles draws a grid of `SUPERSAMPLING` x `SUPERSAMPLING` rays per pixel with one sample each. Colour
is the mean of the grid; id and depth are those of its middle ray, the pixel's centre.
"""

from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
import OpenImageIO

from pe_runtime.contract.errors import EpisodeError

SUPERSAMPLING = 3  # odd, so that one ray goes through the pixel's centre
_BACKGROUND_DEPTH = 1e9  # Cycles writes 1e10 where nothing is
_SMALLEST_FILTER = 0.01  # pixels; Cycles accepts no narrower one


@dataclass(frozen=True)
class Picture:
    """One rendered view.

    Attributes:
        colour: (height, width, 3) uint8 sRGB.
        ids: (height, width) uint8 object index, 0 where no indexed object is.
        depth: (height, width) float32 planar z in metres, +inf where nothing is.
    """

    colour: np.ndarray
    ids: np.ndarray
    depth: np.ndarray


def prepare(scene: bpy.types.Scene, width: int, height: int, samples: int, file: Path) -> None:
    """Set the scene up for `render`.

    Args:
        scene: Its engine, film and output settings are overwritten.
        width: Pixel columns of the pictures.
        height: Pixel rows.
        samples: Cycles samples of each of the grid's rays; 1 is exact for the built-in
            scenes, those with soft light need more.
        file: Where the raw render goes, rewritten for every picture.
    """
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = SUPERSAMPLING * width, SUPERSAMPLING * height
    render.resolution_percentage = 100
    render.use_border = render.use_compositing = render.use_sequencer = False
    render.use_motion_blur = render.film_transparent = False
    render.threads_mode, render.threads = "FIXED", 1
    render.use_persistent_data = True
    render.filepath, render.use_file_extension = str(file), False
    cycles.device = "CPU"
    cycles.samples, cycles.seed, cycles.use_animated_seed = samples, 0, False
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.pixel_filter_type, cycles.filter_width = "BOX", _SMALLEST_FILTER
    layer = scene.view_layers[0]
    layer.use_pass_combined = layer.use_pass_z = layer.use_pass_object_index = True
    image = render.image_settings
    if hasattr(image, "media_type"):
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format = "OPEN_EXR_MULTILAYER"
    image.color_depth, image.exr_codec = "32", "NONE"


def render(scene: bpy.types.Scene, camera: bpy.types.Object) -> Picture:
    """Draw the current frame through `camera`.

    Raises:
        EpisodeError: If Blender wrote no complete picture.
    """
    scene.camera = camera
    bpy.ops.render.render(write_still=True, scene=scene.name)
    channels = _read_channels(Path(scene.render.filepath))
    colour = np.stack([channels["Combined.R"], channels["Combined.G"], channels["Combined.B"]], -1)
    middle = slice(SUPERSAMPLING // 2, None, SUPERSAMPLING)
    depth = channels["Depth.Z"][middle, middle]
    index = channels["Index.X"][middle, middle]
    return Picture(
        colour=srgb_bytes(_grid_mean(colour)),
        ids=np.rint(index).astype(np.uint8),
        depth=np.where(depth < _BACKGROUND_DEPTH, depth, np.inf).astype(np.float32),
    )


def srgb_bytes(colour: np.ndarray) -> np.ndarray:
    """Scene-linear colour to 8-bit sRGB, clipped (the view transform Standard)."""
    c = np.clip(colour, 0.0, 1.0)
    encoded = np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055)
    return np.rint(encoded * 255).astype(np.uint8)


def _grid_mean(fine: np.ndarray) -> np.ndarray:
    rows, columns, channels = fine.shape
    n = SUPERSAMPLING
    return fine.reshape(rows // n, n, columns // n, n, channels).mean(axis=(1, 3))


def _read_channels(file: Path) -> dict[str, np.ndarray]:
    """Channels of a multilayer EXR by the end of their name, whatever the layer is called."""
    image = OpenImageIO.ImageInput.open(str(file))
    if image is None:
        raise EpisodeError(f"Blender rendered nothing readable to {file}: {OpenImageIO.geterror()}")
    channels: dict[str, np.ndarray] = {}
    part = 0
    # Blender 5 writes one part per pass, older versions all channels into one.
    while image.seek_subimage(part, 0):
        names = image.spec().channelnames
        pixels = image.read_image(part, 0, 0, len(names), "float")
        if pixels is None:
            raise EpisodeError(f"{file} is incomplete: {image.geterror()}; is the disk full?")
        for k, name in enumerate(names):
            channels[_short_name(name)] = pixels[..., k]
        part += 1
    image.close()
    return channels


def _short_name(channel: str) -> str:
    # "ViewLayer.Object Index.X" in Blender 5, "ViewLayer.IndexOB.X" before.
    end = ".".join(channel.split(".")[-2:])
    return {"Object Index.X": "Index.X", "IndexOB.X": "Index.X"}.get(end, end)
