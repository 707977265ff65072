"""Looking at the picture through its camera, in the 3D view, before anything is encoded."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import bpy
import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ShotError

from .cameras import Size, has_shape, hold_camera, known_camera, own_camera
from .opening import show_picture_behind
from .picture_source import find_picture
from .view_mapping import PictureFrame, fitted_between, frame_in_view

PLACEHOLDER_EYE = (0.0, -10.0, 3.0)
PLACEHOLDER_PITCH = 0.2
"""Radians below the horizon of the camera through which a picture without one is seen."""
PLACEHOLDER_FOCAL = 1.1
"""Share of the picture's width."""
SIDES = ("UI", "TOOLS")
"""Regions that lie over a 3D view."""
RENDER_SIZE = ("resolution_x", "resolution_y", "resolution_percentage")


def show_picture(scene: bpy.types.Scene, edits: Iterable[bpy.types.Scene]) -> bpy.types.Object:
    """Put the scene's picture behind its camera, made if it is not the artist's own.

    Returns:
        The camera object to look through.

    Raises:
        CameraError, ShotError: There is no picture, or the chosen camera does not fit it.
    """
    found = find_picture(scene, edits).keep()
    settings = scene.playable_environment
    camera, holder = known_camera(scene, settings.framing.facts, found.size)
    if settings.framing.camera_mode == "SCENE":
        if holder is None:
            raise ShotError("choose a camera of the scene in step 2, Camera")
    else:
        with _film_untouched(scene, found.size):
            holder = _held(scene, camera, found.size)
    show_picture_behind(scene, holder, found.path)
    settings.framing.is_open = True
    return holder


def look_through(context: bpy.types.Context, holder: bpy.types.Object) -> None:
    """Let the 3D view that an operator was called in look through a camera, as large as it fits.

    Args:
        context: Of a 3D view; a sidebar of it will do.
        holder: Even where the scene films with another camera.
    """
    space, area = context.space_data, context.area
    space.use_local_camera = context.scene.camera != holder
    space.camera = holder
    space.region_3d.view_perspective = "CAMERA"
    region = next(each for each in area.regions if each.type == "WINDOW")
    with context.temp_override(area=area, region=region):
        bpy.ops.view3d.view_center_camera()
    sides = [each for each in area.regions if each.type in SIDES and each.width > 1]
    left = sum(each.width for each in sides if each.x <= region.x)
    right = sum(each.width for each in sides if each.x > region.x)
    if context.preferences.system.use_region_overlap:
        view = space.region_3d
        zoom, view.view_camera_offset[0] = fitted_between(
            view.view_camera_zoom, region.width, left, right
        )
        view.view_camera_zoom = zoom


def picture_in_view(
    region: bpy.types.Region, space: bpy.types.SpaceView3D, scene: bpy.types.Scene, size: Size
) -> PictureFrame | None:
    """Where a 3D view that looks through a camera shows the picture; None where it does not."""
    holder = space.camera if space.use_local_camera else scene.camera
    if space.region_3d.view_perspective != "CAMERA" or holder is None or holder.type != "CAMERA":
        return None
    # Blender looks through a scaled camera as if it had no scale.
    matrix = np.array(holder.matrix_world.normalized(), np.float64)
    frame = np.array([corner[:] for corner in holder.data.view_frame(scene=scene)], np.float64)
    corners = frame @ matrix[:3, :3].T + matrix[:3, 3]
    clip_from_world = np.array(space.region_3d.perspective_matrix, np.float64)
    return frame_in_view(corners, clip_from_world, (region.width, region.height), size)


def _held(scene: bpy.types.Scene, camera: Camera | None, size: Size) -> bpy.types.Object:
    """The scene's picture camera; where nobody knows the camera yet, wherever it stood before."""
    held = own_camera(scene)
    if camera is None and held is not None and has_shape(scene.render, size):
        scene.camera = held
        return held
    return hold_camera(scene, camera or placeholder(size), 0.0)


def placeholder(size: Size) -> Camera:
    """A camera to show a picture with while its own is unknown."""
    width, height = size
    cosine, sine = np.cos(PLACEHOLDER_PITCH), np.sin(PLACEHOLDER_PITCH)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[1.0, 0.0, 0.0], [0.0, -sine, cosine], [0.0, -cosine, -sine]])
    pose[:3, 3] = PLACEHOLDER_EYE
    focal = PLACEHOLDER_FOCAL * width
    intrinsics = np.array([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]])
    return Camera(width, height, intrinsics, pose)


@contextmanager
def _film_untouched(scene: bpy.types.Scene, size: Size) -> Iterator[None]:
    """Where there is an environment already, its camera and resolution stay as they are."""
    films = scene.playable_environment.root is not None and scene.camera is not None
    camera = scene.camera
    resolution = {name: getattr(scene.render, name) for name in RENDER_SIZE}
    keeps_size = films and has_shape(scene.render, size)
    yield
    if films:
        scene.camera = camera
    if keeps_size:
        for name, value in resolution.items():
            setattr(scene.render, name, value)
