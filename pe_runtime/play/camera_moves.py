"""Moves of the camera about the players; each leaves the horizon as level as it was.

seen from above                 seen from the side

  players = pivot                      camera ^ raise
      +  - - .                               /
      |        `                           /  keeps the pivot's row of pixels
dolly |          ) orbit               pivot +____________________ ground
      |        '
   camera - -'  (+: anticlockwise, to the camera's own right)
"""

import math
from dataclasses import dataclass

import numpy as np

from pe_runtime.contract.camera import Camera

NEAREST = 1.0
"""Metres from the pivot at which a dolly stops."""
LOWEST = 0.1
"""Metres above the ground at which lowering stops."""


@dataclass(frozen=True)
class CameraMove:
    """How far the camera has moved from where the take began.

    Attributes:
        orbit: Degrees about the vertical through the pivot, anticlockwise seen from above.
        rise: Metres up.
        dolly: Metres towards the pivot.
    """

    orbit: float = 0.0
    rise: float = 0.0
    dolly: float = 0.0

    def __add__(self, other: "CameraMove") -> "CameraMove":
        """Both moves, one after the other."""
        return CameraMove(
            self.orbit + other.orbit, self.rise + other.rise, self.dolly + other.dolly
        )

    def __mul__(self, share: float) -> "CameraMove":
        """A share of the move."""
        return CameraMove(self.orbit * share, self.rise * share, self.dolly * share)


def moved_camera(camera: Camera, pivot: np.ndarray, move: CameraMove) -> Camera:
    """The camera after a move; parts of it that are zero change no bit.

    Args:
        camera: Where the camera stood.
        pivot: (3,) what it moves about, world, metres.
        move: How far.
    """
    camera = _orbited(camera, pivot, move.orbit) if move.orbit else camera
    camera = _risen(camera, pivot, move.rise) if move.rise else camera
    return _dollied(camera, pivot, move.dolly) if move.dolly else camera


def resized_camera(camera: Camera, width: int, height: int) -> Camera:
    """The same view at another width; another height shows more or less above and below.

    Unlike `Camera.scaled` it keeps the shape of pixels, so nothing looks stretched.
    """
    scale = width / camera.width
    same_view = camera.scaled(width, camera.height)
    intrinsics = same_view.intrinsics.copy()
    intrinsics[1, 1] *= scale
    intrinsics[1, 2] = height / 2 + (intrinsics[1, 2] - camera.height / 2) * scale
    return Camera(width, height, intrinsics, camera.world_from_camera)


def _orbited(camera: Camera, pivot: np.ndarray, degrees: float) -> Camera:
    angle = math.radians(degrees)
    turn = np.eye(3)
    turn[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    pose = camera.world_from_camera.copy()
    pose[:3, :3] = turn @ pose[:3, :3]
    pose[:3, 3] = pivot + turn @ (pose[:3, 3] - pivot)
    return _placed(camera, pose)


def _risen(camera: Camera, pivot: np.ndarray, metres: float) -> Camera:
    """Up or down, and tilted about the camera's own right axis so that the pivot keeps its row."""
    pose = camera.world_from_camera.copy()
    before = _elevation(pose, pivot)
    height = pose[2, 3]
    pose[2, 3] = max(height + metres, min(height, LOWEST))
    tilt = _elevation(pose, pivot) - before
    turn = np.eye(3)
    turn[1:, 1:] = [[math.cos(tilt), math.sin(tilt)], [-math.sin(tilt), math.cos(tilt)]]
    pose[:3, :3] = pose[:3, :3] @ turn
    return _placed(camera, pose)


def _elevation(pose: np.ndarray, point: np.ndarray) -> float:
    """Angle below the viewing axis at which a point stands in the camera's upright plane."""
    _, down, forward = (point - pose[:3, 3]) @ pose[:3, :3]
    return math.atan2(down, forward)


def _dollied(camera: Camera, pivot: np.ndarray, metres: float) -> Camera:
    pose = camera.world_from_camera.copy()
    away = pose[:3, 3] - pivot
    distance = float(np.linalg.norm(away))
    if distance == 0.0:  # On the pivot itself there is no towards.
        return camera
    left = max(distance - metres, min(distance, NEAREST))
    pose[:3, 3] = pivot + away * (left / distance)
    return _placed(camera, pose)


def _placed(camera: Camera, pose: np.ndarray) -> Camera:
    return Camera(camera.width, camera.height, camera.intrinsics, pose)
