"""What the pickles in a camera's folder say, checked, in the release's own terms."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pe_runtime.contract.errors import EpisodeError
from pe_runtime.interop.dataset_values import Pose, doubled
from pe_runtime.interop.unpickling import read_pickle

EXTRAS = ("rewards", "dones", "metadata")
"""Pickles that our episodes keep for people to read."""
NORMALISED = 2.0
"""Median reach of boxes in picture sizes above which they cannot be normalised."""
FARTHEST = 100.0
"""Reach of a box in picture sizes beyond which it tells nothing."""
LARGEST_FOCAL = 1e6
LARGEST_ACTION, UNKNOWN = 127, -1


@dataclass(frozen=True, eq=False)
class Annotations:
    """T frames of D players through one camera.

    Attributes:
        angles: (T, 3) float64 Euler angles of the camera, radians.
        translations: (T, 3) float64 positions of the camera, metres.
        focals: (T,) float64 pixels of the picture that was annotated.
        boxes: (T, D, 4) float64 left, top, right, bottom as shares of the picture.
        valid: (T, D) bool, whether a box is said to be one.
        actions: (T,) int64 action taken from each frame, if known; UNKNOWN where not.
        positions: (T, D, 3) float64 positions of the players, metres, if known.
        extras: The pickles of EXTRAS as they are.
        defaulted: Names of pickles that are missing and can be done without.
        notes: What else was left aside, and why.
        unreadable: Why extras are missing that are there.
    """

    angles: np.ndarray
    translations: np.ndarray
    focals: np.ndarray
    boxes: np.ndarray
    valid: np.ndarray
    actions: np.ndarray | None
    positions: np.ndarray | None
    extras: Mapping[str, Any]
    defaulted: tuple[str, ...]
    notes: tuple[str, ...]
    unreadable: tuple[str, ...]

    @property
    def present(self) -> np.ndarray:
        """(T, D) bool, whether a box is valid, has an area and lies in the picture."""
        left, top, right, bottom = np.moveaxis(np.nan_to_num(self.boxes, nan=0.0), -1, 0)
        reach = np.abs(np.where(np.isfinite(self.boxes), self.boxes, np.inf)).max(-1)
        proper = (right > left) & (bottom > top) & (reach < FARTHEST)
        return self.valid & proper & (right > 0) & (bottom > 0) & (left < 1) & (top < 1)


def read_annotations(folder: Path, frames: int) -> Annotations:
    """Read a camera's pickles.

    Args:
        folder: The camera's folder.
        frames: Number of its pictures; every list has one entry for each.

    Raises:
        EpisodeError: A pickle that is needed is missing, unsafe, damaged or of another length.
    """
    cameras = _needed(folder, "cameras", frames, _pose)
    boxes = np.stack(_needed(folder, "bounding_boxes", frames, _box))
    players = boxes.shape[1]
    valid = _validity(folder, boxes)
    _check_normalised(folder, boxes[valid])
    positions, useless = _positions(folder, frames, players)
    extras, unreadable = _extras(folder)
    return Annotations(
        np.stack([each.rotation for each in cameras]),
        np.stack([each.translation for each in cameras]),
        np.array(_needed(folder, "focals", frames, _focal)),
        boxes,
        valid,
        _actions(folder, frames),
        positions,
        extras,
        tuple(name for name in _DEFAULTED if not (folder / f"{name}.pkl").is_file()),
        () if useless is None else (useless,),
        unreadable,
    )


_DEFAULTED = ("bounding_box_validity", "actions", *EXTRAS)


def _needed(folder: Path, name: str, frames: int, entry: Callable[[Any], Any]) -> list[Any]:
    """The entries of a pickle that must be there."""
    file = folder / f"{name}.pkl"
    if not file.is_file():
        raise EpisodeError(f"{file} is missing; without it the pictures cannot be used")
    return _entries(file, (frames,), entry)


def _entries(file: Path, lengths: tuple[int, ...], entry: Callable[[Any], Any]) -> list[Any]:
    """A pickle's entries, each read by `entry`, all of one shape.

    Args:
        file: The pickle.
        lengths: How many there may be; the first is said in the error.
        entry: Reads one; raises ValueError.
    """
    found = read_pickle(file)
    if isinstance(found, np.ndarray) and found.ndim:
        found = list(found)
    if not isinstance(found, list | tuple):
        raise EpisodeError(f"{file} holds {type(found).__name__}; expected a list over frames")
    if len(found) not in lengths:
        raise EpisodeError(
            f"{file} has {len(found)} entries for {lengths[0]} pictures; expected one each"
        )
    read = []
    for number, each in enumerate(found):
        try:
            read.append(entry(each))
        except (ValueError, OverflowError) as error:
            raise EpisodeError(f"{file}, frame {number}: {error}") from error
    shapes = {np.shape(each) for each in read}
    if len(shapes) > 1:
        raise EpisodeError(f"{file} changes its shape: {sorted(shapes)}; expected the same players")
    return read


def _pose(found: object) -> Pose:
    if not isinstance(found, Pose):
        raise ValueError(f"expected a pose, found {type(found).__name__}")
    if not (np.isfinite(found.rotation).all() and np.isfinite(found.translation).all()):
        raise ValueError("the camera's pose holds NaN or infinity")
    return found


def _focal(found: object) -> float:
    numbers = _numbers(found)
    if numbers.size != 1 or not 0 < numbers.item() < LARGEST_FOCAL:
        raise ValueError("the focal length is no number of pixels above 0")
    return numbers.item()


def _box(found: object) -> np.ndarray:
    """(D, 4), of (4, D)."""
    box = _numbers(found)
    if box.ndim != 2 or box.shape[0] != 4 or not box.size:
        raise ValueError(f"expected boxes of shape (4, players), found {box.shape}")
    return box.T


def _flags(found: object) -> np.ndarray:
    return _numbers(found).reshape(-1) != 0


def _numbers(found: object) -> np.ndarray:
    """A number, a list of numbers or an array, as float64."""
    if isinstance(found, list | tuple):
        if not all(isinstance(each, bool | int | float | np.generic) for each in found):
            raise ValueError("expected numbers")
        return np.array(found, np.float64)
    if not isinstance(found, bool | int | float | np.generic | np.ndarray):
        raise ValueError(f"expected numbers, found {type(found).__name__}")
    return doubled(np.asarray(found))


def _validity(folder: Path, boxes: np.ndarray) -> np.ndarray:
    """(T, D) bool; without a pickle every box is one that has numbers."""
    file = folder / "bounding_box_validity.pkl"
    if not file.is_file():
        return np.isfinite(boxes).all(-1)
    valid = np.stack(_entries(file, (len(boxes),), _flags))
    if valid.shape != boxes.shape[:2]:
        raise EpisodeError(
            f"{file} tells of {valid.shape[1]} players, bounding_boxes.pkl of {boxes.shape[1]}"
        )
    return valid


def _check_normalised(folder: Path, boxes: np.ndarray) -> None:
    finite = boxes[np.isfinite(boxes).all(-1)]
    if len(finite) and np.median(np.abs(finite).max(-1)) > NORMALISED:
        raise EpisodeError(
            f"{folder / 'bounding_boxes.pkl'}: boxes reach {np.abs(finite).max():g}; expected "
            "shares of the picture's size, from 0 to 1"
        )


def _actions(folder: Path, frames: int) -> np.ndarray | None:
    """(T,), or (T, D) where players have actions of their own."""
    file = folder / "actions.pkl"
    if not file.is_file():
        return None
    # The last frame's action leads nowhere; some lists end before it.
    actions = np.array(_entries(file, (frames, frames - 1), _action))
    if (actions != np.round(actions)).any():
        raise EpisodeError(f"{file}: actions are not whole numbers")
    whole = np.clip(actions, -1, LARGEST_ACTION + 1).astype(np.int64)
    whole[whole > LARGEST_ACTION] = UNKNOWN
    return np.concatenate([whole, np.full(frames - len(whole), UNKNOWN)])


def _action(found: object) -> float:
    numbers = _numbers(found)
    if numbers.size != 1:
        raise ValueError(f"expected one action, found {numbers.size}")
    return numbers.item()


def _positions(folder: Path, frames: int, players: int) -> tuple[np.ndarray | None, str | None]:
    """Positions by object poses, or why those that exist are of no use."""
    file = folder / "object_poses.pkl"
    if not file.is_file():
        return None, None
    rows = np.stack(_entries(file, (frames,), _translations))
    if rows.shape[1:] != (players, 3):
        return None, f"object_poses.pkl has {rows.shape[1]} objects for {players} players"
    return rows, None


def _translations(found: object) -> np.ndarray:
    """(objects, 3)."""
    if not isinstance(found, list | tuple) or not all(isinstance(each, Pose) for each in found):
        raise ValueError("expected a list of poses, one for each object")
    return np.array([each.translation for each in found]).reshape(-1, 3)


def _extras(folder: Path) -> tuple[dict[str, Any], tuple[str, ...]]:
    """What is kept for people to read, and why some of it is not: no reason to lose a sequence."""
    extras, unreadable = {}, []
    for name in EXTRAS:
        file = folder / f"{name}.pkl"
        try:
            extras |= {name: read_pickle(file)} if file.is_file() else {}
        except EpisodeError as error:
            unreadable.append(str(error))
    return extras, tuple(unreadable)
