"""A sequence of the release as the numbers of our episodes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from pe_runtime.contract.episode import EpisodeArrays
from pe_runtime.geometry.cameras import Cameras
from pe_runtime.interop.conventions import (
    camera_from_theirs,
    focal_from_theirs,
    positions_from_theirs,
)
from pe_runtime.interop.dataset_annotations import UNKNOWN, Annotations
from pe_runtime.perception.localization import locate

FOCAL_SIZE = (512, 288)
"""Pixels of the picture that multiplied focal lengths are meant for."""


@dataclass(frozen=True)
class Terms:
    """How the release's numbers are to be taken.

    Attributes:
        up: Up axis of its world, "z" or "y".
        focal_multiplier: From stored focal lengths to pixels of FOCAL_SIZE.
        size: Pixel columns and rows of the episodes.
        knows_actions: Whether actions are those that were taken.
    """

    up: str
    focal_multiplier: float
    size: tuple[int, int]
    knows_actions: bool


def episode_arrays(views: Sequence[Annotations], frames: range, terms: Terms) -> EpisodeArrays:
    """The numbers of some frames of a sequence.

    Where players stand is told by object poses, if there are any, else by the lower edges of their
    boxes in the first camera, where they meet the ground. In frames that do not tell, a player is
    between the places before and after; one who is never seen is at the origin.

    Args:
        views: Every camera's annotations.
        frames: Which frames.
        terms: How to take them.
    """
    rows = np.array(frames)
    cameras = [
        [
            camera_from_theirs(
                view.angles[row],
                view.translations[row],
                focal_from_theirs(view.focals[row], terms.focal_multiplier),
                FOCAL_SIZE,
                terms.up,
            ).scaled(*terms.size)
            for row in rows
        ]
        for view in views
    ]
    present = np.stack([view.present[rows] for view in views])
    boxes = np.stack([view.boxes[rows] for view in views]) * np.tile(terms.size, 2)
    boxes = np.where(present[..., None], boxes, np.nan).astype(np.float32)
    if views[0].positions is None:
        found, known = locate(Cameras.stack(cameras[0]), torch.from_numpy(boxes[0]))
        positions, known = found.numpy().astype(np.float64), known.numpy()
    else:
        told = views[0].positions[rows]
        known = np.isfinite(told).all(-1)
        positions = positions_from_theirs(np.where(known[..., None], told, 0.0), terms.up)
    return EpisodeArrays(
        np.array([[camera.intrinsics for camera in row] for row in cameras]),
        np.array([[camera.world_from_camera for camera in row] for row in cameras]),
        boxes,
        present,
        _filled(positions, known),
        _actions(views[0], rows, terms.knows_actions),
    )


def part_of(arrays: EpisodeArrays, first: int, frames: int) -> EpisodeArrays:
    """So many frames of a sequence, from the first."""
    rows = slice(first, first + frames)
    return EpisodeArrays(
        arrays.intrinsics[:, rows],
        arrays.world_from_camera[:, rows],
        arrays.boxes[:, rows],
        arrays.present[:, rows],
        arrays.positions[rows],
        arrays.actions[first : first + frames - 1],
    )


def _filled(positions: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Positions (T, D, 3) with the unknown ones drawn between their neighbours in time."""
    filled = np.zeros_like(positions)
    times = np.arange(len(positions))
    for player in range(positions.shape[1]):
        told = known[:, player]
        if told.any():
            for axis in range(3):
                track = positions[told, player, axis]
                filled[:, player, axis] = np.interp(times, times[told], track)
    return filled


def _actions(view: Annotations, rows: np.ndarray, known: bool) -> np.ndarray:
    """(T - 1, D): the release has one action a frame, which is everybody's."""
    shape = (len(rows) - 1, view.boxes.shape[1])
    if view.actions is None or not known:
        return np.full(shape, UNKNOWN, np.int8)
    return np.tile(view.actions[rows[:-1], None].astype(np.int8), (1, shape[1]))
