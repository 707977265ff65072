"""Where a viewport looks from, and at which part of it the picture stands."""

import bpy
import numpy as np

from pe_runtime.contract.camera import Camera

from ..scene_bridge import camera_of, inverse_of
from .view_camera import Rect, seen_of_frame, view_camera


def look(
    context: bpy.types.Context, depsgraph: bpy.types.Depsgraph, environment_from_world: np.ndarray
) -> tuple[Rect, Camera] | None:
    """The part of a region that shows the environment, and the camera that fills it.

    Through a camera that is the frame of the render, seen by the very camera of the render; in
    any other view it is the whole region.

    Args:
        context: Of the region.
        depsgraph: Of the region's scene.
        environment_from_world: (4, 4) float64.

    Returns:
        None where the camera's frame is out of sight.

    Raises:
        CameraError: The view or its camera is not in perspective.
    """
    region, view = context.region, context.region_data
    size = region.width, region.height
    exact = None
    if view.view_perspective == "CAMERA":
        exact = _exact_camera(context.space_data, depsgraph, environment_from_world)
    world_from_view = inverse_of(np.array(view.view_matrix, np.float64))
    whole = view_camera(
        np.array(view.window_matrix, np.float64), environment_from_world @ world_from_view, size
    )
    return (Rect(0, 0, *size), whole) if exact is None else seen_of_frame(exact, whole)


def is_covered(context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> bool:
    """Whether Blender draws a background picture of the camera over whatever an engine draws."""
    space = context.space_data
    if context.region_data.view_perspective != "CAMERA" or not space.overlay.show_overlays:
        return False
    holder = _holder(space, depsgraph)
    return (
        holder is not None
        and holder.data.show_background_images
        and any(each.show_background_image for each in holder.data.background_images)
    )


def covered_bottom(area: bpy.types.Area, region: bpy.types.Region) -> int:
    """Pixels at a region's lower border that the panel of the last operator covers."""
    # A hidden one stands at the window's origin, or has no size.
    shown = (
        each.y + each.height - region.y
        for each in area.regions
        if each.type == "HUD" and each.height > 1 and each.y >= region.y
    )
    return max(shown, default=0)


def _holder(
    space: bpy.types.SpaceView3D, depsgraph: bpy.types.Depsgraph
) -> bpy.types.Object | None:
    """The evaluated camera that a camera view looks through; None if it is something else."""
    holder = depsgraph.scene_eval.camera
    if space.use_local_camera and space.camera is not None:
        holder = space.camera.evaluated_get(depsgraph)
    return holder if holder is not None and holder.type == "CAMERA" else None


def _exact_camera(
    space: bpy.types.SpaceView3D, depsgraph: bpy.types.Depsgraph, environment_from_world: np.ndarray
) -> Camera | None:
    """The camera of the render; None where the view looks through something else than one."""
    holder = _holder(space, depsgraph)
    if holder is None:
        return None
    return camera_of(holder, depsgraph.scene_eval.render, environment_from_world)
