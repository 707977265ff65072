"""Where pictures of a scene are usually taken from, for those who have no matching camera yet."""

import bpy
import numpy as np

from pe_runtime.contract.camera import Camera

from .scene_bridge import look_through

# The middle of what the built-in model was trained on: metres, radians.
EYE = np.array([0.0, -8.5, 2.6])
TARGET = np.array([0.0, 0.0, 1.0])
FIELD_OF_VIEW = np.radians(50.0)


def usual_camera(width: int, height: int) -> Camera:
    """A camera in front of the environment's origin, level, looking at people of usual size."""
    forward = (TARGET - EYE) / np.linalg.norm(TARGET - EYE)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = EYE
    focal = width / 2 / np.tan(FIELD_OF_VIEW / 2)
    intrinsics = np.array([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]])
    return Camera(width, height, intrinsics, pose)


def add_usual_camera(scene: bpy.types.Scene, size: tuple[int, int]) -> bpy.types.Object:
    """Give a scene the usual camera and the picture's resolution (width, height)."""
    name = "Environment Camera"
    holder = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    scene.collection.objects.link(holder)
    look_through(holder, scene.render, usual_camera(*size))
    scene.camera = holder
    return holder
