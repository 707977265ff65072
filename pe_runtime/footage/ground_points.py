"""The camera of a picture, from points on the ground whose places somebody knows.

Square pixels, the principal point in the middle, no distortion: what is left to find is the pose
and, where it is not given, the focal length.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from scipy.optimize import minimize_scalar

from pe_runtime.contract.camera import Camera, project
from pe_runtime.contract.errors import CameraError

FEWEST_POINTS = 4
FOCAL_SHARES = (0.25, 40.0)
"""Shortest and longest focal length tried, as a share of the picture's longer side."""
FOCAL_STEPS = 61
NARROW = 1e-3
"""Least spread of points across the line through them, as a share of that along it."""
TELLING = 0.02
"""Pixels by which the residual must grow for a focal length one fifth off, or it is a guess."""
WRONG_SHARE = 0.03
"""A residual above this share of the picture's diagonal is no camera but a mix-up of points."""


@dataclass(frozen=True)
class MatchedCamera:
    """A camera and how well the points fit it.

    Attributes:
        camera: The camera that sees the points, environment space.
        residual: Root mean square distance between points and their places, pixels.
        worst: The largest such distance, pixels.
    """

    camera: Camera
    residual: float
    worst: float


def match_camera(
    size: tuple[int, int],
    points: Any,  # noqa: ANN401 a JSON value, or an array
    focal: float | None = None,
) -> MatchedCamera:
    """The camera from which points of the ground appear where they do.

    Args:
        size: Width and height of the picture, pixels.
        points: Four or more [u, v, x, y]: a pixel and the metres of its place on the ground.
        focal: Focal length in pixels; None to find it too.

    Raises:
        CameraError: The points are too few, on one line, or no camera above the ground sees them
            so; or they do not tell the focal length.
    """
    if min(size) < 1:
        raise CameraError(f"the picture is {size[0]}x{size[1]} pixels; expected 1 or more")
    if focal is not None and not (np.isfinite(focal) and focal > 0):
        raise CameraError(f"the focal length is {focal!r} pixels; expected a number above 0")
    listed = _checked(points)
    if focal is None:
        focal = _find_focal(size, listed)
    found = _best(size, listed, focal)
    if found is None:
        raise CameraError(
            "no camera above the ground sees the points so: they appear mirrored, as if seen from "
            "below, or one lies far off; check that none are swapped and that x and y are not"
        )
    limit = WRONG_SHARE * float(np.hypot(*size))
    if found.residual > limit:
        distances = _distances(found.camera, listed)
        number = int(distances.argmax())
        raise CameraError(
            f"no camera fits the points: they miss by {found.residual:.0f} pixels on average, "
            f"point {number + 1} at pixel {listed[number, :2].round(1).tolist()} by "
            f"{distances[number]:.0f}; check the places on the ground and their order"
        )
    return found


def _checked(points: Any) -> np.ndarray:  # noqa: ANN401
    """The points as (n, 4) float64, spread widely enough to tell a camera."""
    try:
        listed = np.array(points, np.float64)
    except (TypeError, ValueError) as error:
        raise CameraError(f"the points are not numbers: {error}") from error
    if listed.size and (listed.ndim != 2 or listed.shape[1] != 4):
        raise CameraError(
            f"points are rows of u, v, x and y, found an array of shape {listed.shape}"
        )
    if len(listed) < FEWEST_POINTS:
        raise CameraError(
            f"a camera is matched from {FEWEST_POINTS} points on the ground or more, found "
            f"{len(listed)}; add {FEWEST_POINTS - len(listed)}"
        )
    if not np.isfinite(listed).all():
        raise CameraError("a point is NaN or infinite; place it again")
    for what, places in (("in the picture", listed[:, :2]), ("on the ground", listed[:, 2:])):
        _check_spread(what, places)
    return listed


def _check_spread(what: str, places: np.ndarray) -> None:
    """Refuse points of which all, or all but one, lie on one line: they leave the camera open."""
    subsets = [places, *(np.delete(places, index, axis=0) for index in range(len(places)))]
    for each in subsets:
        along, across = np.linalg.svd(each - each.mean(axis=0), compute_uv=False)
        if across <= NARROW * along:
            raise CameraError(
                f"the points lie on one line {what}, or all but one do; spread them, such as to "
                "four corners of a rectangle"
            )


def _find_focal(size: tuple[int, int], points: np.ndarray) -> float:
    """The focal length in pixels with the smallest residual."""

    def cost(log_focal: float) -> float:
        found = _best(size, points, float(np.exp(log_focal)))
        return np.inf if found is None else found.residual**2

    longest = max(size)
    grid = np.log(np.geomspace(*(share * longest for share in FOCAL_SHARES), FOCAL_STEPS))
    costs = np.array([cost(each) for each in grid])
    if not np.isfinite(costs).any():
        return float(np.exp(grid[len(grid) // 2]))  # the caller says what is wrong
    best = int(costs.argmin())
    bounds = grid[max(best - 1, 0)], grid[min(best + 1, FOCAL_STEPS - 1)]
    refined = minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": 1e-9})
    _check_told(np.sqrt(refined.fun), [np.sqrt(cost(refined.x + step)) for step in (-0.2, 0.2)])
    return float(np.exp(refined.x))


def _check_told(least: float, beside: Sequence[float]) -> None:
    if min(beside) - least < TELLING:
        raise CameraError(
            "the points do not tell the focal length: other lenses fit as well. Give the focal "
            "length, or place points nearer and farther; from straight above none can tell it"
        )


def _best(size: tuple[int, int], points: np.ndarray, focal: float) -> MatchedCamera | None:
    """The camera above the ground of this focal length that fits best; None if there is none."""
    width, height = size
    intrinsics = np.array([[focal, 0.0, width / 2], [0.0, focal, height / 2], [0.0, 0.0, 1.0]])
    pixels = np.ascontiguousarray(points[:, None, :2])
    ground = np.pad(points[:, 2:], ((0, 0), (0, 1)))[:, None]
    middle = ground.mean(axis=0, keepdims=True)
    try:
        _, turns, shifts, _ = cv2.solvePnPGeneric(
            ground - middle, pixels, intrinsics, None, flags=cv2.SOLVEPNP_IPPE
        )
    except cv2.error:
        return None
    found = []
    for turn, shift in zip(turns, shifts, strict=True):
        turn, shift = cv2.solvePnPRefineLM(ground - middle, pixels, intrinsics, None, turn, shift)
        pose = np.eye(4)
        pose[:3, :3] = cv2.Rodrigues(turn)[0].T
        pose[:3, 3] = -pose[:3, :3] @ shift[:, 0] + middle[0, 0]
        if not np.isfinite(pose).all() or pose[2, 3] <= 0:
            continue
        camera = Camera(width, height, intrinsics, pose)
        distances = _distances(camera, points)
        if np.isfinite(distances).all():
            residual = float(np.sqrt((distances**2).mean()))
            found.append(MatchedCamera(camera, residual, float(distances.max())))
    return min(found, key=lambda each: each.residual, default=None)


def _distances(camera: Camera, points: np.ndarray) -> np.ndarray:
    """Pixels between the points and where the camera sees their places; NaN behind it."""
    seen, _ = project(camera, np.pad(points[:, 2:], ((0, 0), (0, 1))))
    return np.linalg.norm(seen - points[:, :2], axis=1)
