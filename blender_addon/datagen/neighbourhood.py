"""The second camera of `duel-camera`: it starts where the first does and explores around there.

Its pictures are the truth that novel views are measured against. Pure numpy.
"""

import numpy as np

from blender_addon.datagen.viewpoints import Viewpoint, shows_person

ORBIT_DEGREES = (6.0, 14.0)  # farthest way around the court's middle
CLIMB_METRES = (0.3, 0.9)
APPROACH_METRES = (0.3, 1.2)
LOWEST_EYE = 1.4  # metres
SMALLEST_PERSON = 32 / 144  # of the picture's height

_ATTEMPTS = 200


def explore(rng: np.random.Generator, first: list[Viewpoint], feet: np.ndarray) -> list[Viewpoint]:
    """A smooth path in the neighbourhood of the first camera's first viewpoint.

    Args:
        rng: Where the draws come from.
        first: The first camera, frame by frame.
        feet: (frames, players, 3) where the players stand, metres.

    Returns:
        One viewpoint per frame, the first equal to `first[0]`. Everybody stays in the picture,
        unless no such path was found.
    """
    path = first
    for _ in range(_ATTEMPTS):
        path = _draw_path(rng, first[0], len(first))
        if all(
            shows_person(view, foot, SMALLEST_PERSON)
            for view, places in zip(path, feet, strict=True)
            for foot in places
        ):
            break
    return path


def _draw_path(rng: np.random.Generator, start: Viewpoint, frames: int) -> list[Viewpoint]:
    orbit = np.radians(_excursion(rng, ORBIT_DEGREES, frames))
    climb = _excursion(rng, CLIMB_METRES, frames)
    approach = _excursion(rng, APPROACH_METRES, frames)
    from_target = start.eye - start.target
    distance = np.linalg.norm(from_target[:2])
    heading = np.arctan2(from_target[1], from_target[0])
    views = []
    for t in range(frames):
        reach, angle = distance - approach[t], heading + orbit[t]
        eye = start.target + (reach * np.cos(angle), reach * np.sin(angle), from_target[2])
        eye[2] = max(eye[2] + climb[t], min(start.eye[2], LOWEST_EYE))
        views.append(Viewpoint(eye, start.target, start.field_of_view))
    return views


def _excursion(rng: np.random.Generator, reach: tuple[float, float], frames: int) -> np.ndarray:
    """(frames,) a smooth way out from 0, to either side, and part of the way back."""
    farthest = rng.choice([-1.0, 1.0]) * rng.uniform(*reach)
    return farthest * np.sin(np.linspace(0.0, rng.uniform(0.5, 0.9) * np.pi, frames))
