"""The small set on which the add-on's tests play: a camera, boxes, shots, worker commands."""

import sys
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 its own documentation's name

from blender_addon.state_files import picture_in
from blender_addon.worker.worker_client import worker_command
from pe_runtime.contract.camera import Camera
from pe_runtime.contract.shot import SHOT_VERSION, ObjectTrack, Shot, Start

WIDTH, HEIGHT = 64, 36
BOXES = {"player_1": (12.0, 10.0, 20.0, 30.0), "player_2": (40.0, 11.0, 49.0, 29.0)}
FAKE = worker_command(sys.executable, ["--fake"])


def faulty(mode):
    return [sys.executable, "-u", str(Path(__file__).with_name("faulty_worker.py")), mode]


def front_camera(width=WIDTH, height=HEIGHT):
    """At (0, -8, 2.5), looking along +y and a little down; exact in float32."""
    pose = np.eye(4)
    pose[:3, :3] = np.array([[1.0, 0.0, 0.0], [0.0, -0.28, 0.96], [0.0, -0.96, -0.28]])
    pose[:3, 3] = 0.0, -8.0, 2.5
    intrinsics = np.array([[width, 0.0, width / 2], [0.0, width, height / 2], [0.0, 0.0, 1.0]])
    return Camera(width, height, intrinsics, pose)


def picture_of(width=WIDTH, height=HEIGHT):
    """All 256 bytes if there is room, different in every channel."""
    values = np.arange(width * height * 3).reshape(height, width, 3)
    return (values * 7 % 256).astype(np.uint8)


def opened_picture(scene):
    """The picture that a scene's environment was made from, as the start of a Shot."""
    block = scene.playable_environment.state_text
    return picture_in(block.as_string(), block.name)


def shot_of(image, frames=4, **changes):
    fields = {
        "version": SHOT_VERSION,
        "model": "fake",
        "start": Start(image=str(image), camera=front_camera(), boxes=BOXES),
        "fps": 10.0,
        "frame_start": 1,
        "frame_end": frames,
        "cameras": (front_camera(),) * frames,
        "objects": tuple(ObjectTrack(name, ((1, 1),)) for name in BOXES),
        "passes": ("depth", "mask:player_1"),
    }
    return Shot(**(fields | changes))


def read_png(path):
    """The (height, width, 3) bytes of a file, as another program than Blender reads them."""
    return np.asarray(oiio.ImageInput.open(str(path)).read_image(oiio.UINT8))[..., :3]


def render_layers(scene, path):
    """Render a still of a scene with all its passes into a multilayer EXR."""
    import bpy

    output = scene.render.image_settings
    if hasattr(output, "media_type"):
        output.media_type = "MULTI_LAYER_IMAGE"
    output.file_format, output.color_depth = "OPEN_EXR_MULTILAYER", "32"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True, scene=scene.name)
    return path


def exr_channels(path, layer=""):
    """Channel arrays by `Pass.Channel`, over all parts of the file or those of a view layer."""
    found, source = {}, oiio.ImageInput.open(str(path))
    part = 0
    while source.seek_subimage(part, 0):
        pixels = source.read_image(part, 0, 0, source.spec().nchannels, oiio.FLOAT)
        for index, name in enumerate(source.spec().channelnames):
            if name.startswith(layer):
                found[".".join(name.split(".")[-2:])] = pixels[..., index]
        part += 1
    source.close()
    return found
