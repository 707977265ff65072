"""Where pictures of a model's world are usually taken from, for those who have no camera yet."""

import bpy
import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.model_facts import ModelFacts

from .scene_bridge import look_through

CAMERA_NAME = "Environment Camera"
CLIP_MARGIN = 1.5


def usual_camera(facts: ModelFacts, width: int, height: int) -> Camera:
    """The model's usual camera, as wide as it is, on the square pixels of a picture.

    Raises:
        ShotError: Nobody knows where the model's pictures are taken from.
    """
    usual = facts.usual_camera
    if usual is None:
        raise ShotError(
            f"nobody knows where pictures of {facts.name!r} are usually taken from; add a camera "
            "that matches the picture"
        )
    scale, intrinsics = width / usual.width, usual.intrinsics.copy()
    intrinsics[:2, :2] *= scale
    middle = np.array([usual.width, usual.height]) / 2
    intrinsics[:2, 2] = np.array([width, height]) / 2 + scale * (intrinsics[:2, 2] - middle)
    return Camera(width, height, intrinsics, usual.world_from_camera)


def put_camera(
    scene: bpy.types.Scene,
    eye: Camera,
    world_from_environment: np.ndarray,
    reach: float,
    holder: bpy.types.Object | None = None,
) -> bpy.types.Object:
    """Give a scene a camera and the resolution of its picture.

    Args:
        scene: Gets the camera as its active one.
        eye: What it sees, environment space.
        world_from_environment: (4, 4) matrix of the environment root; uniform scale allowed.
        reach: Environment metres that the viewport should show before it.
        holder: A camera without parent that is changed; None for a new one.
    """
    if holder is None:
        holder = bpy.data.objects.new(CAMERA_NAME, bpy.data.cameras.new(CAMERA_NAME))
        scene.collection.objects.link(holder)
    scale = float(np.linalg.norm(world_from_environment[:3, 0]))
    world_from_camera = world_from_environment @ eye.world_from_camera
    world_from_camera[:3, :3] /= scale
    look_through(
        holder, scene.render, Camera(eye.width, eye.height, eye.intrinsics, world_from_camera)
    )
    holder.data.clip_end = max(holder.data.clip_end, CLIP_MARGIN * scale * reach)
    scene.camera = holder
    return holder
