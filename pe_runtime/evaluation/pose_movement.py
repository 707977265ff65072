"""How pose codes move: in play against what recorded frames are encoded into."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pe_runtime.contract.episode import Episode
from pe_runtime.evaluation.rules import LONG_PLAY
from pe_runtime.evaluation.subject import Evaluated, cameras_of, encoded, mean_told
from pe_runtime.state import EnvironmentState

SMALLEST_DEVIATION = 1e-3
"""Floor of a code's standard deviation, for numbers of it that never change."""


@dataclass(frozen=True)
class EncodedPoses:
    """Pose codes that recorded frames are encoded into, by player.

    Attributes:
        mean: (pose,) of each player.
        deviation: (pose,) standard deviation, with a floor where a code never changes.
        liveliness: Mean movement of the codes within windows of walking; NaN without any.
    """

    mean: Mapping[str, np.ndarray]
    deviation: Mapping[str, np.ndarray]
    liveliness: float

    def in_deviations(self, name: str, codes: np.ndarray) -> np.ndarray:
        """(time, pose) codes as distances from the mean in standard deviations."""
        return (codes - self.mean[name]) / self.deviation[name]


def encoded_poses(
    environment: Evaluated, episodes: Sequence[Episode], walking: Sequence[int]
) -> EncodedPoses:
    """Encode all frames of some sequences.

    Args:
        environment: A model with actions.
        episodes: Sequences that show all players in every frame.
        walking: The actions that count as walking.
    """
    codes: dict[str, list[np.ndarray]] = {name: [] for name in environment.playable_names}
    sequences = []
    for episode in episodes:
        states = [encoded(environment, episode, t) for t in range(episode.arrays.frames)]
        inferred = environment.infer_actions(states, cameras_of(episode))
        for name, track in codes.items():
            track.append(pose_codes(states, name))
            sequences.append((name, track[-1], np.asarray(inferred[name])))
    joined = {name: np.concatenate(each) for name, each in codes.items()}
    mean = {name: each.mean(0) for name, each in joined.items()}
    deviation = {name: np.maximum(each.std(0), SMALLEST_DEVIATION) for name, each in joined.items()}
    # Movement of codes is counted in deviations, so that no number of the code outweighs another.
    lively = [
        liveliness(poses[:-1] / deviation[name], np.where(np.isin(actions, walking), actions, -1))
        for name, poses, actions in sequences
    ]
    return EncodedPoses(mean, deviation, mean_told(lively))


def liveliness(poses: np.ndarray, walk: np.ndarray) -> float:
    """Root mean variance of codes over time, within windows of one and the same walk.

    Args:
        poses: (time, pose) codes in deviations.
        walk: (time,) which action the player walks by; negative while it stands.

    Returns:
        NaN if it never walks for as long as a window. 0 for codes without numbers.
    """
    window = LONG_PLAY.window
    starts = range(len(poses) - window + 1)
    spans = [slice(start, start + window) for start in starts]
    steady = [span for span in spans if walk[span].min() >= 0 and np.ptp(walk[span]) == 0]
    variances = [poses[span].var(axis=0).sum() for span in steady]
    variances = [each / max(poses.shape[1], 1) for each in variances]
    return math.sqrt(float(np.mean(variances))) if variances else math.nan


def pose_codes(states: Sequence[EnvironmentState], name: str) -> np.ndarray:
    """(time, pose) float64."""
    return np.stack([state[name].pose.detach().cpu().double().numpy() for state in states])


def distance_from_mean(codes: np.ndarray) -> np.ndarray:
    """(time,) root mean square of codes in deviations: about 1 where they are as when encoded."""
    if codes.shape[1] == 0:
        return np.zeros(len(codes))
    return np.sqrt((codes**2).mean(axis=1))
