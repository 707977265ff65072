"""How well discrete actions explain movement, and how far a rollout strays from the truth."""

import math

import numpy as np
import torch
from jaxtyping import Float, Int

from pe_runtime.action.movement import ground_axes, movements
from pe_runtime.evaluation.rules import RULES

MOST_NEIGHBOURS = 15
SLOWEST_WALK = RULES.slowest_walk
"""Metres per step below which an action's mean movement is no walking."""


def camera_relative_movements(
    positions: Float[np.ndarray, "time objects 3"],
    world_from_camera: Float[np.ndarray, "time 4 4"],
) -> Float[np.ndarray, "steps objects 2"]:
    """Delta of the paper: each step's ground movement, (right, forward) of its first camera.

    Args:
        positions: Metres, world.
        world_from_camera: The cameras that filmed, one per time; OpenCV axes.
    """
    axes = ground_axes(torch.from_numpy(world_from_camera[:, :3, :3].astype(np.float64)))
    tracks = torch.from_numpy(positions.astype(np.float64)).transpose(0, 1)
    steps = movements(tracks, axes.expand(tracks.shape[0], -1, -1, -1))
    return steps.transpose(0, 1).numpy()


def delta_mse(
    moves: Float[np.ndarray, "samples axes"], actions: Int[np.ndarray, " samples"]
) -> float:
    """Delta-MSE in percent: error of the best guess of a movement from its action.

    The best guess is the action's mean movement; the mean squared error is divided by the variance
    of all movements. 0 if actions say everything, 100 if they say nothing.

    Returns:
        NaN without samples or without any movement.
    """
    total = float(((moves - moves.mean(0)) ** 2).sum()) if len(moves) else 0.0
    if total == 0.0:
        return math.nan
    groups = (moves[actions == action] for action in np.unique(actions))
    left = sum(float(((group - group.mean(0)) ** 2).sum()) for group in groups)
    return 100.0 * left / total


def delta_accuracy(
    moves: Float[np.ndarray, "samples axes"],
    actions: Int[np.ndarray, " samples"],
    sequence: Int[np.ndarray, " samples"],
) -> float:
    """Delta-Acc in percent: how often the action can be told from the movement.

    A vote of the nearest neighbours (15, or the root of the sample count where that is less) that
    knows the even sequences guesses the odd ones, and the other way round: no step is guessed with
    the help of its own sequence.

    Args:
        moves: Movements.
        actions: The action that goes with each.
        sequence: Number of the sequence each was taken from.

    Returns:
        NaN if all sequences are even, or all odd.
    """
    even = sequence % 2 == 0
    if even.all() or not even.any():
        return math.nan
    hits = [
        _vote(moves[known], actions[known], moves[~known]) == actions[~known]
        for known in (even, ~even)
    ]
    return 100.0 * float(np.concatenate(hits).mean())


def with_standing_merged(
    moves: Float[np.ndarray, "samples axes"],
    actions: Int[np.ndarray, " samples"],
    slowest: float = SLOWEST_WALK,
) -> Int[np.ndarray, " samples"]:
    """Actions by which nobody walks, as one: they cannot be told apart by movement.

    Args:
        moves: Metres per step.
        actions: The action that goes with each.
        slowest: An action whose mean movement is shorter than this counts as standing.
    """
    standing = standing_actions(moves, actions, slowest)
    return np.where(np.isin(actions, standing), min(standing, default=0), actions)


def standing_actions(
    moves: Float[np.ndarray, "samples axes"],
    actions: Int[np.ndarray, " samples"],
    slowest: float = SLOWEST_WALK,
) -> list[int]:
    """The actions whose mean movement is shorter than the slowest walk."""
    every = np.unique(actions).tolist()
    return [a for a in every if np.linalg.norm(moves[actions == a].mean(0)) < slowest]


def standing_accuracy(
    moves: Float[np.ndarray, "samples axes"],
    inferred: Int[np.ndarray, " samples"],
    true: Int[np.ndarray, " samples"],
    sequence: Int[np.ndarray, " samples"],
) -> float:
    """Balanced accuracy in percent of telling the true standing actions apart by inferred ones.

    Which true action an inferred one means is the majority on the other half of the sequences
    (even for odd and the reverse), each true action counting the same in all. Movement cannot help
    here: only the pose tells an idle player from one who raises an arm.

    Args:
        moves: Metres per step.
        inferred: What the model read off the pictures.
        true: What the recorder carried out.
        sequence: Number of the sequence each was taken from.

    Returns:
        Mean of the recalls; NaN with fewer than two standing actions, or if one of them is not
        among the even and among the odd sequences. Chance is 100 over their number.
    """
    classes = standing_actions(moves, true)
    even = sequence % 2 == 0
    halves = [(classes_in(true[half], classes), half) for half in (even, ~even)]
    if len(classes) < 2 or any(found != classes for found, _ in halves):
        return math.nan
    guesses = np.full(true.shape, -1)
    for known, asked in ((even, ~even), (~even, even)):
        # Shares of each true action, so that a frequent one does not take every label.
        shares = {
            label: [np.mean(inferred[known & (true == c)] == label) for c in classes]
            for label in np.unique(inferred).tolist()
        }
        for label, each in shares.items():
            guesses[asked & (inferred == label)] = classes[int(np.argmax(each))]
    return 100.0 * float(np.mean([(guesses[true == c] == c).mean() for c in classes]))


def classes_in(labels: Int[np.ndarray, " samples"], classes: list[int]) -> list[int]:
    """Those of the classes that occur among the labels."""
    return [each for each in classes if (labels == each).any()]


def normalised_mutual_information(
    a: Int[np.ndarray, " samples"], b: Int[np.ndarray, " samples"]
) -> float:
    """2 I(a; b) / (H(a) + H(b)): 1 if two labellings agree up to names, 0 if independent.

    Returns:
        NaN without samples; 1 if both have one label only.
    """
    if a.size == 0:
        return math.nan
    _, a = np.unique(a, return_inverse=True)
    _, b = np.unique(b, return_inverse=True)
    joint = np.zeros((a.max() + 1, b.max() + 1))
    np.add.at(joint, (a, b), 1.0 / a.size)
    both = _entropy(joint.sum(1)) + _entropy(joint.sum(0))
    if both == 0.0:
        return 1.0
    return max(0.0, 2.0 * (both - _entropy(joint.ravel())) / both)


def position_errors(
    predicted: Float[np.ndarray, "time objects 3"], true: Float[np.ndarray, "time objects 3"]
) -> Float[np.ndarray, "time objects"]:
    """Distances on the ground in metres; heights are ignored."""
    return np.linalg.norm((predicted - true)[..., :2], axis=-1).astype(np.float64)


def _vote(
    known: Float[np.ndarray, "known axes"],
    labels: Int[np.ndarray, " known"],
    asked: Float[np.ndarray, "asked axes"],
) -> Int[np.ndarray, " asked"]:
    """Most frequent label among the nearest known samples; the smaller label wins a tie."""
    voters = min(MOST_NEIGHBOURS, max(1, round(math.sqrt(len(known)))))
    distances = ((asked[:, None] - known[None]) ** 2).sum(-1)
    nearest = np.argsort(distances, axis=1, kind="stable")[:, :voters]
    classes = np.unique(labels)
    counts = (labels[nearest][..., None] == classes).sum(1)
    return classes[counts.argmax(1)]


def _entropy(shares: Float[np.ndarray, " outcomes"]) -> float:
    present = shares[shares > 0]
    return float(-(present * np.log(present)).sum())
