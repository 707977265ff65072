"""The cameras of `duel`: smooth paths in front of the court, and what they see of a person.

Pure numpy. A viewpoint is independent of the picture size: it assumes a picture of 16:9, and
thresholds are shares of its height.
"""

from dataclasses import dataclass

import numpy as np

ASPECT = 16 / 9
AZIMUTH_DEGREES = 25.0
AZIMUTH_RATE = 3.0  # degrees per step, largest
DISTANCE = (7.5, 9.5)
HEIGHT = (1.8, 3.5)
FIELD_OF_VIEW = (48.0, 52.0)  # horizontal, degrees
SECOND_VIEW_DEGREES = (8.0, 20.0)
SECOND_VIEW_HEIGHT_GAP = 0.4

PERSON_HEIGHT = 1.8
SMALLEST_PERSON = 41 / 144  # of the picture's height
MARGIN = 2 / 144  # of the picture's height, kept free around a person
_REACH = 0.45  # half the width in metres that must stay inside the frame
_LEGS_REACH = 0.25  # half the width in metres of a person's legs, and some
_TOP = 2.15  # metres, hand of a raised arm


@dataclass(frozen=True)
class Viewpoint:
    """A camera at one moment: where it is (3,), what it looks at (3,), horizontal fov (radians)."""

    eye: np.ndarray
    target: np.ndarray
    field_of_view: float


def plan_views(rng: np.random.Generator, frames: int) -> tuple[list[Viewpoint], list[Viewpoint]]:
    """Draw the main camera's path and the second camera's, one viewpoint per frame each."""
    share = np.linspace(0.0, 1.0, frames)
    azimuth = _glide(rng, share, (-AZIMUTH_DEGREES, AZIMUTH_DEGREES), AZIMUTH_RATE * (frames - 1))
    distance = _glide(rng, share, DISTANCE, 1.0)
    height = _glide(rng, share, HEIGHT, 0.8)
    target = _target_path(rng, share)
    angle = np.radians(rng.uniform(*FIELD_OF_VIEW))
    first = _path(azimuth, distance, height, target, angle)

    azimuth = azimuth + _second_offset(rng, azimuth)
    distance = _glide(rng, share, DISTANCE, 1.0)
    low, high = HEIGHT[0], HEIGHT[1] - 2 * SECOND_VIEW_HEIGHT_GAP
    other = rng.uniform(low, high)
    other += 2 * SECOND_VIEW_HEIGHT_GAP * (other > height.mean() - SECOND_VIEW_HEIGHT_GAP)
    target = _target_path(rng, share)
    second = _path(azimuth, distance, np.full(frames, other), target, angle)
    return first, second


def ground_axes(view: Viewpoint) -> tuple[np.ndarray, np.ndarray]:
    """The camera's right and forward directions (3,), projected on the ground, unit length."""
    forward = (view.target - view.eye) * (1.0, 1.0, 0.0)
    forward /= np.linalg.norm(forward)
    return np.array([forward[1], -forward[0], 0.0]), forward


def camera_axes(view: Viewpoint) -> np.ndarray:
    """Rotation world_from_camera (3, 3) with OpenCV's axes: x right, y down, z forward."""
    forward = view.target - view.eye
    forward = forward / np.linalg.norm(forward)
    right, _ = ground_axes(view)
    return np.stack([right, np.cross(forward, right), forward], axis=1)


def shows_person(
    view: Viewpoint,
    foot: np.ndarray,
    smallest: float = SMALLEST_PERSON,
    reach: float = _REACH,
    top: float = _TOP,
) -> bool:
    """Whether a person standing at `foot` (3,) is wholly in the picture and large enough.

    Args:
        view: The camera.
        foot: Ground point in metres.
        smallest: Height of a person as a share of the picture's.
        reach: Metres to each side that must be in the picture.
        top: Metres above the ground that must be.
    """
    rotation = camera_axes(view)
    right, _ = ground_axes(view)
    corners = [foot + side * reach * right + (0, 0, z) for side in (-1, 1) for z in (0, top)]
    corners += [foot, foot + (0, 0, PERSON_HEIGHT)]
    in_camera = (np.array(corners) - view.eye) @ rotation
    # One unit = the picture's height; the origin is the picture's centre.
    focal = 0.5 * ASPECT / np.tan(view.field_of_view / 2)
    x, y = focal * in_camera[:, :2].T / in_camera[:, 2]
    inside = (abs(x) <= ASPECT / 2 - MARGIN).all() and (abs(y) <= 0.5 - MARGIN).all()
    return bool(inside and y[-2] - y[-1] >= smallest)


def hides_feet(view: Viewpoint, feet: np.ndarray) -> bool:
    """Whether one of two people at `feet` (2, 3) stands in front of the other's feet."""
    in_camera = (feet - view.eye) @ camera_axes(view)
    sideways = in_camera[:, 0] / in_camera[:, 2]
    return bool(abs(sideways[0] - sideways[1]) < _LEGS_REACH / in_camera[:, 2].min())


def _glide(
    rng: np.random.Generator, share: np.ndarray, bounds: tuple[float, float], reach: float
) -> np.ndarray:
    """A smooth path inside `bounds` whose end lies within `reach` of its start."""
    start = rng.uniform(*bounds)
    end = np.clip(start + rng.uniform(-reach, reach), *bounds)
    return start + (end - start) * share


def _target_path(rng: np.random.Generator, share: np.ndarray) -> np.ndarray:
    start = rng.uniform((-0.25, -0.25, 0.82), (0.25, 0.25, 0.98))
    end = start + rng.uniform(-0.15, 0.15, 3) * (1.0, 1.0, 0.4)
    return start + (end - start) * share[:, None]


def _second_offset(rng: np.random.Generator, azimuth: np.ndarray) -> float:
    """Degrees to add to the first camera's azimuth, keeping the second inside the same range."""
    offset = rng.uniform(*SECOND_VIEW_DEGREES)
    room = {-1.0: azimuth.min() + AZIMUTH_DEGREES, 1.0: AZIMUTH_DEGREES - azimuth.max()}
    side = rng.choice([-1.0, 1.0])
    if room[side] < offset:
        side = max(room, key=room.__getitem__)
    return side * min(offset, room[side])


def _path(
    azimuth: np.ndarray,
    distance: np.ndarray,
    height: np.ndarray,
    target: np.ndarray,
    field_of_view: float,
) -> list[Viewpoint]:
    angle = np.radians(azimuth)
    eyes = np.stack([distance * np.sin(angle), -distance * np.cos(angle), height], axis=1)
    return [Viewpoint(eye, aim, field_of_view) for eye, aim in zip(eyes, target, strict=True)]
