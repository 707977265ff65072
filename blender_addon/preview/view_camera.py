"""The pinhole camera behind a part of the viewport, from Blender's matrices. No `bpy` here."""

from dataclasses import dataclass

import numpy as np

from pe_runtime.contract.camera import OPENCV_FROM_BLENDER_AXES, Camera
from pe_runtime.contract.errors import CameraError

PERSPECTIVE_NEEDED = (
    "Rendered shading needs a perspective view: press 5 on the number pad, or 0 for the camera"
)


@dataclass(frozen=True)
class Rect:
    """A part of a region of the window, in whole pixels from its top left corner."""

    left: int
    top: int
    width: int
    height: int


def view_camera(
    window_matrix: np.ndarray, environment_from_view: np.ndarray, size: tuple[int, int]
) -> Camera:
    """The camera that fills a region of the window.

    Args:
        window_matrix: (4, 4) projection of the view.
        environment_from_view: (4, 4) from the view's axes (x right, y up, looking along -z) into
            environment space; uniform scale allowed.
        size: Width and height of the region in pixels.

    Raises:
        CameraError: The view is not in perspective.
    """
    if abs(window_matrix[3, 3]) > 1e-6:
        raise CameraError(PERSPECTIVE_NEEDED)
    width, height = size
    intrinsics = np.eye(3)
    intrinsics[0, 0], intrinsics[1, 1] = np.diagonal(window_matrix)[:2] * (width / 2, height / 2)
    intrinsics[0, 2] = (1 - window_matrix[0, 2]) * width / 2
    intrinsics[1, 2] = (1 + window_matrix[1, 2]) * height / 2
    return Camera(width, height, intrinsics, rigid(environment_from_view))


def rigid(matrix: np.ndarray) -> np.ndarray:
    """A view's matrix without scale and rounding, looking along +z with y down."""
    axes = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
    left, _, right = np.linalg.svd(axes)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = left @ right, matrix[:3, 3]
    return pose @ OPENCV_FROM_BLENDER_AXES


def seen_of_frame(exact: Camera, view: Camera) -> tuple[Rect, Camera] | None:
    """The part of a camera's frame that the region shows, and the camera that fills it.

    Args:
        exact: The scene's camera with the grid of the render.
        view: The camera of the whole region, which looks through it.

    Returns:
        The part in pixels of the region, and the exact camera on the grid of these pixels; None
        where the frame lies outside the region.
    """
    scale = view.intrinsics[[0, 1], [0, 1]] / exact.intrinsics[[0, 1], [0, 1]]
    start = view.intrinsics[:2, 2] - scale * exact.intrinsics[:2, 2]
    end = start + scale * (exact.width, exact.height)
    bounds = np.array([view.width, view.height])
    first = np.clip(np.rint(start), 0, bounds).astype(int)
    last = np.clip(np.rint(end), 0, bounds).astype(int)
    width, height = (int(extent) for extent in last - first)
    if width < 1 or height < 1:
        return None
    intrinsics = np.eye(3)
    intrinsics[0, 0], intrinsics[1, 1] = scale * exact.intrinsics[[0, 1], [0, 1]]
    intrinsics[:2, 2] = scale * exact.intrinsics[:2, 2] + start - first
    rect = Rect(int(first[0]), int(first[1]), width, height)
    return rect, Camera(width, height, intrinsics, exact.world_from_camera)
