"""Noise on an episode's annotations: what camera estimators and detectors get wrong.

Only the first view's cameras and boxes are disturbed: a model is trained and fed with them.
Positions, actions and further views serve evaluation and stay true. Pure numpy.
"""

from dataclasses import dataclass, fields, replace

import numpy as np

from pe_runtime.contract.episode import EpisodeArrays
from pe_runtime.contract.errors import EpisodeError

OUTLIER_SPAN = 0.35  # largest error of an outlier's edge as a share of the box
LONGEST_ABSENCE = 3  # frames that one dropout lasts at most
SMALLEST_BOX = 2.0  # pixels that are left of a box's width and height

# An estimated camera drifts more than it trembles; the squares of the two add up to 1.
_DRIFT, _TREMBLE = 0.95, float(np.sqrt(1 - 0.95**2))
_MEMORY = 0.9  # share of the drift that is left one frame later
_VIEW = 0


@dataclass(frozen=True)
class Noise:
    """How much is wrong; 0 switches a kind off.

    Attributes:
        camera_degrees: Standard deviation of the camera's rotation about each of its axes.
        camera_metres: Standard deviation of the camera's place along each axis.
        focal: Standard deviation of the focal length as a share of it.
        box_pixels: Standard deviation of each edge of a box.
        outliers: Share of the boxes whose edges are off by up to a third of their size.
        dropout: Share of the boxes that are missing, in gaps of 1 to 3 frames.
    """

    camera_degrees: float = 0.2
    camera_metres: float = 0.05
    focal: float = 0.005
    box_pixels: float = 1.0
    outliers: float = 0.02
    dropout: float = 0.05

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            highest = 1.0 if each.name in ("outliers", "dropout") else np.inf
            if not (0 <= value <= highest and np.isfinite(value)):
                raise EpisodeError(
                    f"noise: {each.name} is {value}; expected 0 or more"
                    + (", at most 1" if highest == 1.0 else "")
                )


def disturbed(
    arrays: EpisodeArrays, noise: Noise, size: tuple[int, int], seed: tuple[int, ...]
) -> EpisodeArrays:
    """A copy with noise on the first view's cameras and boxes.

    Every kind of noise has its own draws: changing the amount of one leaves the others alone.

    Args:
        arrays: True annotations.
        noise: How much is wrong.
        size: Width and height of the pictures in pixels; boxes stay inside.
        seed: The same numbers give the same noise.
    """
    kinds = ("rotation", "place", "focal", "edges", "outliers", "dropout")
    streams = {kind: np.random.default_rng((*seed, k)) for k, kind in enumerate(kinds)}
    intrinsics, poses = arrays.intrinsics.copy(), arrays.world_from_camera.copy()
    boxes, present = arrays.boxes.copy(), arrays.present.copy()
    frames = arrays.frames

    turns = np.radians(noise.camera_degrees) * _wander(streams["rotation"], frames, 3)
    poses[_VIEW, :, :3, :3] = poses[_VIEW, :, :3, :3] @ _rotations(turns)
    poses[_VIEW, :, :3, 3] += noise.camera_metres * _wander(streams["place"], frames, 3)
    scale = np.exp(noise.focal * _wander(streams["focal"], frames, 1))
    intrinsics[_VIEW, :, (0, 1), (0, 1)] *= scale.T

    # Each frame's box is found anew: no memory.
    moved = boxes[_VIEW] + noise.box_pixels * streams["edges"].standard_normal(boxes[_VIEW].shape)
    moved += _outliers(streams["outliers"], boxes[_VIEW], noise.outliers)
    boxes[_VIEW] = _valid(moved, size)
    present[_VIEW] &= ~_absences(streams["dropout"], present[_VIEW].shape, noise.dropout)
    boxes[_VIEW][~present[_VIEW]] = np.nan
    return replace(
        arrays, intrinsics=intrinsics, world_from_camera=poses, boxes=boxes, present=present
    )


def _wander(rng: np.random.Generator, frames: int, channels: int) -> np.ndarray:
    """(frames, channels) of standard deviation 1: a slow drift and a little tremble."""
    drift = np.zeros((frames, channels))
    fresh, tremble = rng.standard_normal((2, frames, channels))
    for t in range(frames):
        drift[t] = _MEMORY * drift[t - 1] + np.sqrt(1 - _MEMORY**2) * fresh[t] if t else fresh[t]
    return _DRIFT * drift + _TREMBLE * tremble


def _rotations(turns: np.ndarray) -> np.ndarray:
    """Rotations (frames, 3, 3) of rotation vectors (frames, 3) in radians (Rodrigues)."""
    angle = np.linalg.norm(turns, axis=-1)[:, None, None]
    x, y, z = turns.T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(-1, 3, 3)
    # sinc(0) is 1: no turn needs no care.
    first, second = np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    return np.eye(3) + first * cross + second * cross @ cross


def _outliers(rng: np.random.Generator, boxes: np.ndarray, share: float) -> np.ndarray:
    """What to add to the edges (frames, objects, 4): zero but for a few boxes."""
    chosen = rng.random(boxes.shape[:2]) < share
    width, height = boxes[..., 2] - boxes[..., 0], boxes[..., 3] - boxes[..., 1]
    span = OUTLIER_SPAN * np.stack([width, height, width, height], axis=-1)
    return np.where(chosen[..., None], span * rng.uniform(-1, 1, boxes.shape), 0.0)


def _absences(rng: np.random.Generator, shape: tuple[int, ...], share: float) -> np.ndarray:
    """Where (frames, objects) a detector finds nothing, in gaps of a few frames."""
    frames, objects = shape
    starts, lengths = rng.random(shape), rng.integers(1, LONGEST_ABSENCE + 1, shape)
    mean = (1 + LONGEST_ABSENCE) / 2
    # The chance of a start that makes `share` of all frames absent, overlaps allowed for.
    chance = 1 - (1 - share) ** (1 / mean)
    absent = np.zeros(shape, dtype=bool)
    for t, k in np.ndindex(frames, objects):
        if starts[t, k] < chance:
            absent[t : t + lengths[t, k], k] = True
    return absent


def _valid(boxes: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Boxes (..., 4) inside the picture and at least `SMALLEST_BOX` wide and high."""
    limits = np.array(size, dtype=np.float64)
    one, other = np.clip(boxes[..., :2], 0, limits), np.clip(boxes[..., 2:], 0, limits)
    low, high = np.minimum(one, other), np.maximum(one, other)
    low = np.minimum(low, limits - SMALLEST_BOX)
    high = np.maximum(high, low + SMALLEST_BOX)
    return np.concatenate([low, high], axis=-1).astype(np.float32)
