"""The cameras of `court`: high behind the near baseline, fixed in place, panning and zooming.

Pure numpy. World: metres, Z up, the net along x at y = 0; cameras stand at -Y.
"""

import numpy as np

from blender_addon.datagen.viewpoints import Viewpoint

EYE_X, EYE_Y, EYE_HEIGHT = (-0.9, 0.9), (-17.8, -17.0), (6.6, 7.4)
TARGET = (0.0, -0.75, 0.80)
TARGET_SPREAD = (0.35, 0.15, 0.08)
PAN_METRES = 0.35  # largest way of the target to each side within an episode
FIELD_OF_VIEW = (33.5, 35.5)  # horizontal, degrees
ZOOM_DEGREES = 1.2  # largest change within an episode
SECOND_VIEW_METRES = (1.5, 3.0)  # sideways from the first camera

_SLOW = 0.8  # radians a step: the camera follows the play, it does not twitch


def plan_broadcast(
    rng: np.random.Generator, frames: int
) -> tuple[list[Viewpoint], list[Viewpoint]]:
    """Draw the main camera's and the second camera's viewpoints, one per frame each.

    The second camera stands beside the first, a little higher or lower.
    """
    eye = np.array([rng.uniform(*EYE_X), rng.uniform(*EYE_Y), rng.uniform(*EYE_HEIGHT)])
    first = _operate(rng, eye, frames)
    side = -np.sign(eye[0]) if abs(eye[0]) > 0.3 else rng.choice([-1.0, 1.0])
    beside = eye + (side * rng.uniform(*SECOND_VIEW_METRES), rng.uniform(-0.5, 0.5), 0.0)
    beside[2] = rng.uniform(*EYE_HEIGHT)
    return first, _operate(rng, beside, frames)


def fixed_views(frames: int) -> tuple[list[Viewpoint], list[Viewpoint]]:
    """The cameras of `static-court`, the same in every episode: both look at the near half."""
    target, angle = np.array([0.0, -2.9, 0.85]), np.radians(27.0)
    eyes = np.array([0.0, -17.0, 6.0]), np.array([2.4, -16.8, 6.4])
    return tuple([Viewpoint(eye, target, angle)] * frames for eye in eyes)


def _operate(rng: np.random.Generator, eye: np.ndarray, frames: int) -> list[Viewpoint]:
    """Pan and zoom smoothly from one place."""
    time = np.arange(frames)
    middle = np.array(TARGET) + rng.uniform(-1, 1, 3) * TARGET_SPREAD
    pan = PAN_METRES * rng.uniform(0.2, 1.0) * _wave(rng, time)
    tilt = 0.3 * PAN_METRES * _wave(rng, time)
    low, high = FIELD_OF_VIEW
    zoom = rng.uniform(low, high) + 0.5 * ZOOM_DEGREES * _wave(rng, time)
    views = []
    for t in range(frames):
        target = middle + (pan[t], tilt[t], 0.0)
        views.append(Viewpoint(eye, target, float(np.radians(np.clip(zoom[t], low, high)))))
    return views


def _wave(rng: np.random.Generator, time: np.ndarray) -> np.ndarray:
    """A slow wave between -1 and 1."""
    return np.sin(rng.uniform(0, 2 * np.pi) + rng.uniform(0.2, 1.0) * _SLOW * time)
