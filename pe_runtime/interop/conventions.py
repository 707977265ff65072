"""Frames of reference of the authors' release, and how they become ours.

    their camera axes (OpenGL's)       ours (OpenCV's)
        y up                             z forward
        |  -z forward                   /
        | /                            +---- x right
        +---- x right                  |
                                       y down

Their worlds are right-handed with z up (tennis) or y up (Minecraft); ours is Z up. Poses are Euler
angles (`geometry.native_world`) and a translation; both map from the object or camera into the
world. The ray of their pixel (row, col) passes through ((col - W/2) / f, -(row - H/2) / f, -1); the
strided grids that they and we shoot from meet the same points.
"""

import numpy as np
import torch

from pe_runtime.contract.camera import OPENCV_FROM_BLENDER_AXES, Camera
from pe_runtime.geometry.native_world import WORLD_FROM_NATIVE, rotation_from_euler

FOCAL_MULTIPLIERS = {"tennis": 0.51417, "minecraft": 0.5}
"""Pixels of a 512x288 picture per pixel of the resolution that was annotated."""


def camera_from_theirs(
    angles: np.ndarray, translation: np.ndarray, focal: float, size: tuple[int, int], up: str
) -> Camera:
    """Our camera for one of theirs.

    Args:
        angles: (a, b, c) radians, camera to world.
        translation: Camera position, metres, their world.
        focal: Pixels of an image of the given size.
        size: Width and height in pixels; the principal point is the middle.
        up: Up axis of their world, "z" or "y".

    Raises:
        CameraError: A number is not finite or the focal length not positive.
    """
    turn = WORLD_FROM_NATIVE[up].numpy()
    pose = np.eye(4)
    # In float32, as theirs: the highest octaves of distant objects show the rounding.
    native = torch.from_numpy(np.asarray(angles, np.float32))
    pose[:3, :3] = turn @ rotation_from_euler(native).double().numpy()
    pose[:3, 3] = turn @ np.asarray(translation, np.float64)
    width, height = size
    focal = float(np.float32(focal))
    intrinsics = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]], np.float64)
    return Camera(width, height, intrinsics, pose @ OPENCV_FROM_BLENDER_AXES)


def positions_from_theirs(translations: np.ndarray, up: str) -> np.ndarray:
    """Points (..., 3) of their world in ours, metres, float64."""
    return np.asarray(translations, np.float64) @ WORLD_FROM_NATIVE[up].numpy().T


def focal_from_theirs(annotated: float, multiplier: float) -> float:
    """Focal length in pixels of their 512x288 pictures, from one of the annotated resolution.

    Args:
        annotated: As their files and scene encodings hold it.
        multiplier: `FOCAL_MULTIPLIERS` of the data set.
    """
    return float(np.float32(annotated) * np.float32(multiplier))
