"""What a scene asks of a job, read on the main thread."""

import json
from collections.abc import Iterator, Sequence

import bpy

from pe_runtime.contract.shot import Shot

from ..bake import Bake, Output, bake_of, take_of_moment
from ..filming.render_border import border_of
from ..scene_bridge import frames_per_second, sample_range
from .job import RangeJob, source_of
from .lending import composites
from .plan import Wish

CHUNK = 16
"""Frames that are read before the window gets its turn."""


def read_takes(job: RangeJob) -> Iterator[list[Shot]]:
    """The shots of the job's frames, a few at a time; afterwards the frame is as it was.

    Raises:
        ShotError: The scene cannot be filmed: nothing baked, other actions than were baked ...
    """
    frames = job.frames
    for first in range(0, len(frames), CHUNK):
        scene = source_of(job)
        bake = bake_of(scene.playable_environment)
        yield _takes(scene, bake, frames[first : first + CHUNK])


def wish_of(job: RangeJob, takes: Sequence[Shot], everything: bool, overwrite: bool) -> Wish:
    """The takes and everything else that decides the files of a job."""
    scene = source_of(job)
    return Wish(
        job,
        bake_of(scene.playable_environment).shot,
        takes,
        json.dumps(_settings(scene), sort_keys=True),
        file_size(scene),
        _unknowable(scene),
        everything,
        overwrite,
    )


def file_size(scene: bpy.types.Scene) -> tuple[int, int]:
    """Width and height in pixels of the files that a scene renders."""
    size, border = full_size(scene), border_of(scene.render)
    if border is None or not scene.render.use_crop_to_border:
        return size
    return border.region(*size)[2:]


def full_size(scene: bpy.types.Scene) -> tuple[int, int]:
    """Width and height in pixels of the camera's whole picture; Blender rounds down."""
    render = scene.render
    share = render.resolution_percentage
    return render.resolution_x * share // 100, render.resolution_y * share // 100


def _takes(scene: bpy.types.Scene, bake: Bake, frames: Sequence[int]) -> list[Shot]:
    fps, (width, height) = frames_per_second(scene), full_size(scene)
    output = Output(width, height, scene.playable_environment.quality)
    return [take_of_moment(bake, moment, fps, output) for moment in sample_range(scene, frames)]


def _settings(scene: bpy.types.Scene) -> dict:
    render, view = scene.render, scene.view_settings
    border = ("use_border", "use_crop_to_border")
    edges = ("border_min_x", "border_max_x", "border_min_y", "border_max_y")
    colours = ("view_transform", "look", "exposure", "gamma", "use_curve_mapping")
    balance = ("use_white_balance", "white_balance_temperature", "white_balance_tint")
    return {
        "file": ["PNG", "RGB", "8", *file_size(scene)],
        "aspect": [render.pixel_aspect_x, render.pixel_aspect_y],
        "border": [getattr(render, n) for n in border + (edges if render.use_border else ())],
        "display": scene.display_settings.display_device,
        "view": [getattr(view, name) for name in colours],
        "balance": [getattr(view, n) for n in balance if getattr(view, balance[0], False)],
        "dither": render.dither_intensity,
        "layers": [layer.name for layer in scene.view_layers if layer.use],
    }


def _unknowable(scene: bpy.types.Scene) -> str:
    if composites(scene):
        return "compositor nodes may change any pixel"
    if scene.render.use_stamp:
        return "burnt-in metadata changes with the time of day"
    if scene.view_settings.use_curve_mapping:
        return "curves of the colour management may change any pixel"
    return ""
