"""State sequences of a made-up `duel`, in place of encoded pictures, with the truth beside them.

Two-legged objects walk 0.3 m a step relative to a slowly moving camera, or stand, or raise an arm.
Positions carry the jitter of a box's foot point (more along the view than across it) and poses are
a smooth random map of walking phase, heading and arm, with noise.
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from pe_runtime.training.action_sequences import ActionDataset

IDLE, LEFT, RIGHT, FORWARD, BACK, RAISE = range(6)
DIRECTIONS = np.array([[0, 0], [-1, 0], [1, 0], [0, 1], [0, -1], [0, 0]], dtype=float)
STEP = 0.3


@dataclass(frozen=True)
class Jitter:
    along: float = 0.12
    across: float = 0.05
    pose: float = 0.3
    bias: float = 0.0


@dataclass(frozen=True)
class Synthetic:
    dataset: ActionDataset
    true_positions: Tensor
    true_actions: Tensor


def make_states(sequences, steps=12, seed=0, jitter=Jitter(), codes=16):
    """`code_map` of the poses does not depend on the seed, as one encoder serves all sequences."""
    rng = np.random.default_rng(seed)
    actions = np.stack([_actions(rng, steps - 1) for _ in range(sequences)])
    yaw = _camera_yaw(rng, sequences, steps)
    positions, actions = _walk(rng, actions, yaw)
    poses = _poses(rng, actions, yaw, codes) + jitter.pose * rng.normal(
        size=(sequences, steps, codes)
    )
    seen = positions + _jitter(rng, yaw, jitter)
    styles = np.random.default_rng(seed + 1).normal(size=(sequences, codes))
    dataset = ActionDataset(
        _tensor(seen),
        _tensor(styles),
        _tensor(poses),
        _tensor(rotations(yaw)),
        torch.as_tensor(actions),
    )
    return Synthetic(dataset, _tensor(positions), torch.as_tensor(actions))


def _actions(rng, count):
    track = []
    while len(track) < count:
        track += [int(rng.integers(6))] * int(rng.integers(2, 6))
    return np.array(track[:count], dtype=np.int64)


def _camera_yaw(rng, sequences, steps):
    start = rng.uniform(-25, 25, (sequences, 1))
    speed = rng.uniform(-1.5, 1.5, (sequences, 1))
    return np.radians(np.clip(start + speed * np.arange(steps), -25, 25))


def _walk(rng, actions, yaw):
    """Who would leave the court stands still instead."""
    actions = actions.copy()
    count, moves = actions.shape
    positions = np.zeros((count, moves + 1, 3))
    positions[:, 0, 0] = rng.uniform(-2.2, 2.2, count)
    positions[:, 0, 1] = rng.uniform(-1.5, 1.5, count)
    for t in range(moves):
        step = STEP * _turn(DIRECTIONS[actions[:, t]], yaw[:, t])
        following = positions[:, t, :2] + step
        outside = (np.abs(following) > [3.2, 2.0]).any(axis=1)
        actions[outside, t] = IDLE
        positions[:, t + 1, :2] = np.where(outside[:, None], positions[:, t, :2], following)
    return positions, actions


def _turn(vectors, yaw):
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([np.cos(yaw) * x - np.sin(yaw) * y, np.sin(yaw) * x + np.cos(yaw) * y], -1)


def _poses(rng, actions, yaw, codes):
    count, moves = actions.shape
    phase = rng.uniform(0, 2 * np.pi, count)
    heading = rng.uniform(-np.pi, np.pi, count)
    facing = np.stack([np.cos(heading), np.sin(heading)], -1)
    raised, swing = np.zeros(count), np.zeros(count)
    factors = np.zeros((count, moves + 1, 8))
    for t in range(moves + 1):
        if t:
            direction = _turn(DIRECTIONS[actions[:, t - 1]], yaw[:, t - 1])
            walks = np.linalg.norm(direction, axis=1) > 0.5
            phase += np.where(walks, 1.3, 0.0)
            facing = np.where(walks[:, None], 0.3 * facing + 0.7 * direction, facing)
            facing /= np.linalg.norm(facing, axis=1, keepdims=True) + 1e-9
            swing = 0.3 * swing + 0.7 * walks
            raised = 0.3 * raised + 0.7 * (actions[:, t - 1] == RAISE)
        limbs = [swing * np.sin(phase), swing * np.cos(phase)]
        arm = [raised * facing[:, 0], raised * facing[:, 1]]
        factors[:, t] = np.stack([*limbs, facing[:, 0], facing[:, 1], 2 * raised, swing, *arm], -1)
    code_map = np.random.default_rng(77)
    first = code_map.normal(size=(8, 24)) / np.sqrt(8) * 1.5
    second = code_map.normal(size=(24, codes)) / np.sqrt(24) * 1.5
    return np.tanh(factors @ first) @ second * 1.2


def _jitter(rng, yaw, jitter):
    along = rng.normal(size=yaw.shape) * jitter.along - jitter.bias
    across = rng.normal(size=yaw.shape) * jitter.across
    noise = _turn(np.stack([across, along], -1), yaw)
    return np.concatenate([noise, np.zeros_like(noise[..., :1])], -1)


def rotations(yaw, tilt=0.2):
    """OpenCV camera axes of a camera that looks along +y, turned by yaw, tilted down."""
    c, s = np.cos(yaw), np.sin(yaw)
    zero = np.zeros_like(c)
    right = np.stack([c, s, zero], -1)
    view = np.stack([-s * np.cos(tilt), c * np.cos(tilt), zero - np.sin(tilt)], -1)
    return np.stack([right, np.cross(view, right), view], -1)


def _tensor(array):
    return torch.as_tensor(array, dtype=torch.float32)
