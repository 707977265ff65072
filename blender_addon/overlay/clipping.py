"""What of a line lies before a camera. Without Blender."""

import numpy as np

from pe_runtime.contract.camera import Camera

NEAR = 0.05
"""Metres before a camera at which lines begin; a line through the camera itself has no image."""


def in_front(camera: Camera, ends: np.ndarray, near: float = NEAR) -> np.ndarray:
    """The parts of line segments that lie before a camera's near plane.

    Args:
        camera: The observer.
        ends: (segments, 2, 3) metres, finite.
        near: Metres from the camera to the plane.

    Returns:
        (kept, 2, 3) ends of those segments of which anything is left, in their order.
    """
    kept = np.array(ends, np.float64).reshape(-1, 2, 3)
    depth = depth_of(camera, kept)
    seen = (depth >= near).any(axis=1)
    kept, depth = kept[seen], depth[seen]
    for side in (0, 1):
        behind = depth[:, side] < near
        hidden, shown = kept[behind, side], kept[behind, 1 - side]
        below, above = depth[behind, side], depth[behind, 1 - side]
        share = ((near - below) / (above - below))[:, None]
        kept[behind, side] = hidden + share * (shown - hidden)
    return kept


def depth_of(camera: Camera, points: np.ndarray) -> np.ndarray:
    """Planar depth (...,) in metres of points (..., 3) before a camera."""
    eye, forward = camera.world_from_camera[:3, 3], camera.world_from_camera[:3, 2]
    return (points - eye) @ forward


def unprojected(camera: Camera, pixels: np.ndarray, depth: np.ndarray | float) -> np.ndarray:
    """The points (..., 3) that a camera sees at pixels (..., 2), at a planar depth in metres."""
    pixels = np.asarray(pixels, np.float64)
    centre, focal = camera.intrinsics[:2, 2], camera.intrinsics[[0, 1], [0, 1]]
    sideways = (pixels - centre) / focal
    directions = np.concatenate([sideways, np.ones((*pixels.shape[:-1], 1))], axis=-1)
    in_camera = directions * np.asarray(depth, np.float64)[..., None]
    return in_camera @ camera.world_from_camera[:3, :3].T + camera.world_from_camera[:3, 3]
