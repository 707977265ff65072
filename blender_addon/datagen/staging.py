"""What every built scene has besides its things: time, light, cameras."""

import bpy
import numpy as np
from mathutils import Matrix

from blender_addon.datagen.recordable import VIEW
from blender_addon.datagen.viewpoints import Viewpoint, camera_axes

SUN_TILT = np.radians(15.0)
SUN_SHARE = 0.42  # of the light on a floor; the rest is the materials' own glow


def empty_scene(frames: int, steps_per_second: float) -> bpy.types.Scene:
    """Empty Blender; frames run from 1."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, frames
    scene.render.fps = round(steps_per_second)
    return scene


def add_sun(scene: bpy.types.Scene, rng: np.random.Generator) -> None:
    """A sun without size, nearly overhead."""
    light = bpy.data.lights.new("sun", "SUN")
    light.angle = 0.0
    light.energy = SUN_SHARE * np.pi
    sun = bpy.data.objects.new("sun", light)
    turn, tilt = rng.uniform(0, 2 * np.pi), rng.uniform(0, SUN_TILT)
    sun.rotation_euler = (tilt, 0.0, turn)
    scene.collection.objects.link(sun)


def add_camera(scene: bpy.types.Scene, number: int, path: list[Viewpoint]) -> None:
    """A camera keyed along a path, one viewpoint per frame; number 0 is the scene's own."""
    name = f"camera_{number}"
    data = bpy.data.cameras.new(name)
    data.sensor_fit = "HORIZONTAL"
    camera = bpy.data.objects.new(name, data)
    camera[VIEW] = number
    camera.rotation_mode = "QUATERNION"
    scene.collection.objects.link(camera)
    if number == 0:
        scene.camera = camera
    for frame, view in enumerate(path, start=1):
        pose = np.eye(4)
        # Blender's camera looks down -Z with Y up; ours down +Z with Y down.
        pose[:3, :3] = camera_axes(view) @ np.diag([1.0, -1.0, -1.0])
        pose[:3, 3] = view.eye
        camera.matrix_world = Matrix(pose.tolist())
        camera.keyframe_insert("location", frame=frame)
        camera.keyframe_insert("rotation_quaternion", frame=frame)
        data.angle = view.field_of_view
        data.keyframe_insert("lens", frame=frame)
