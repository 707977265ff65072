"""How a tennis player moves the limbs: joint angles that follow from the actions, pure numpy.

Axes of a player: Z up, facing -Y, left +X. A pose gives each bone its turn against its parent as
Euler angles (radians; about X first, then Y, then Z): -X swings a hanging limb forward, +X bends
a knee, -X an elbow, and leans the trunk back; +Z turns to the left.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from blender_addon.datagen.athlete_shape import HEEL, TOE, skeleton

LARGEST_TURN = 1.0  # away from where the player faces at rest, radians
AFTER_SWING = 0.35  # share of a swing that is left one step later

Pose = Mapping[str, tuple[float, float, float]]

_READY: Pose = {
    "pelvis": (0.10, 0.0, 0.0),
    "chest": (0.22, 0.0, 0.0),
    "head": (-0.22, 0.0, 0.0),
    "thigh.left": (-0.45, -0.16, 0.0),
    "thigh.right": (-0.45, 0.16, 0.0),
    "shin.left": (0.70, 0.0, 0.0),
    "shin.right": (0.70, 0.0, 0.0),
    "foot.left": (-0.35, 0.16, 0.0),
    "foot.right": (-0.35, -0.16, 0.0),
    "upper_arm.left": (-0.35, -0.28, 0.0),
    "upper_arm.right": (-0.30, 0.34, 0.0),
    "forearm.left": (-1.15, 0.0, 0.55),
    "forearm.right": (-1.10, 0.0, -0.35),
    "hand.right": (-0.75, -0.10, 0.0),
}
# The free arm balances the racket, which also keeps the middle of the box near the body.
_CONTACT: Pose = {
    "pelvis": (0.06, 0.0, 0.10),
    "chest": (0.14, 0.14, 0.25),
    "head": (-0.15, -0.10, -0.30),
    "thigh.left": (-0.70, -0.20, 0.0),
    "thigh.right": (0.12, 0.22, 0.0),
    "shin.left": (0.70, 0.0, 0.0),
    "shin.right": (0.45, 0.0, 0.0),
    "foot.left": (-0.06, 0.20, 0.0),
    "foot.right": (-0.20, -0.20, 0.0),
    "upper_arm.left": (0.10, -1.15, 0.0),
    "upper_arm.right": (0.0, 1.20, -0.15),
    "forearm.left": (-0.40, 0.0, 0.0),
    "forearm.right": (-0.55, 0.0, 0.0),
    "hand.right": (0.30, 0.30, 0.0),
}
_FOLLOW: Pose = _CONTACT | {
    "pelvis": (0.06, 0.0, 0.30),
    "chest": (0.10, 0.0, 0.55),
    "head": (-0.10, 0.0, -0.65),
    "upper_arm.right": (-1.55, 0.0, 0.75),
    "forearm.right": (-1.30, 0.0, 0.40),
    "hand.right": (-0.30, 0.0, 0.0),
}
_BACKSWING: Pose = _CONTACT | {
    "pelvis": (0.08, 0.0, -0.35),
    "chest": (0.18, 0.0, -0.60),
    "head": (-0.18, 0.0, 0.75),
    "upper_arm.left": (-0.80, -0.75, 0.0),
    "upper_arm.right": (0.25, 0.95, -0.05),
    "forearm.right": (-0.55, 0.0, 0.0),
    "hand.right": (-0.25, 0.15, 0.0),
}
_STROKE = (_CONTACT, _FOLLOW, _BACKSWING)


@dataclass(frozen=True, eq=False)
class Movement:
    """What one player's body does.

    Attributes:
        yaw: (frames,) heading: 0 faces -Y, growing to the player's left.
        rise: (frames,) metres to lift the body by, so that the lower foot touches the ground.
        poses: One per frame, all bones.
    """

    yaw: np.ndarray
    rise: np.ndarray
    poses: tuple[Pose, ...]


@dataclass(frozen=True)
class Words:
    """What the actions mean to a body.

    Attributes:
        directions: (actions, 2) to the right of the picture and away from the camera, in steps.
        swing: Index of the action that swings the racket.
    """

    directions: np.ndarray
    swing: int


def draw_movement(
    rng: np.random.Generator, actions: np.ndarray, words: Words, faces_camera: bool
) -> Movement:
    """Joint angles of one player; frame t shows the body after action t - 1.

    Args:
        rng: For stride, tempo and small irregularities.
        actions: (frames - 1,) what the player does.
        words: What the actions mean.
        faces_camera: Else the player faces away from the main camera.
    """
    frames = len(actions) + 1
    phase, cadence = rng.uniform(0, 2 * np.pi), rng.uniform(1.2, 1.9)
    stride, turn = rng.uniform(0.85, 1.1), rng.uniform(0.6, 0.95) * LARGEST_TURN
    bob, tempo = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 0.9)
    wobble = np.clip(rng.normal(0, 0.04, (frames, 2)), -0.1, 0.1)
    rest, toward = (0.0, 1.0) if faces_camera else (np.pi, -1.0)
    effort, heading, swung, stroke = float(rng.random() < 0.5), rng.uniform(-0.2, 0.2), 0.0, 0
    yaws, poses = np.zeros(frames), []
    for t in range(frames):
        if t > 0:
            sideways, away = words.directions[actions[t - 1]]
            swings = actions[t - 1] == words.swing
            walks = bool(sideways or away)
            # Away from where one faces is a run backwards; the legs turn the other way round.
            backwards = away * toward > 0
            effort += 0.75 * (walks - effort)
            phase += cadence * max(effort, 0.15) * (-1.0 if backwards else 1.0)
            heading += 0.6 * (turn * sideways - heading)
            stroke = (stroke + 1) % len(_STROKE) if swings and swung == 1.0 else stroke
            stroke = 0 if swings and swung < 1.0 else stroke
            swung = 1.0 if swings else AFTER_SWING * swung
        shown = _STROKE[stroke] if swung == 1.0 else _FOLLOW
        breath = 0.05 * np.sin(bob + tempo * t)
        base = _mixed(_waiting(breath + wobble[t, 0]), _running(phase, stride), effort)
        poses.append(_mixed(base, shown, swung))
        limit = np.clip(heading + wobble[t, 1], -LARGEST_TURN, LARGEST_TURN)
        yaws[t] = rest + toward * limit
    rise = np.array([standing_rise(pose) for pose in poses])
    return Movement(yaws, rise, tuple(poses))


def standing_rise(pose: Pose) -> float:
    """Metres to lift the body by (may be negative) so that the lower sole touches the ground."""
    soles = [point for side in ("left", "right") for point in _sole(pose, side)]
    return -float(min(point[2] for point in soles))


def euler_matrix(angles: tuple[float, float, float]) -> np.ndarray:
    """Rotation (3, 3) about X, then Y, then Z."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles), np.sin(angles)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def _sole(pose: Pose, side: str) -> list[np.ndarray]:
    """Toe and heel (3,) in the player's axes."""
    bones = skeleton()
    x = bones[f"foot.{side}"].head[0]
    points = [np.array([x, -TOE + 0.02, 0.0]), np.array([x, HEEL, 0.0])]
    for part in (f"foot.{side}", f"shin.{side}", f"thigh.{side}", "pelvis"):
        pivot, turn = np.array(bones[part].head), euler_matrix(pose[part])
        points = [pivot + turn @ (point - pivot) for point in points]
    return points


def _waiting(sway: float) -> Pose:
    moved = dict(_READY)
    for part, share in (("chest", 1.0), ("thigh.left", 1.2), ("thigh.right", 1.2)):
        x, y, z = moved[part]
        moved[part] = x + share * sway, y, z
    return moved


def _running(phase: float, stride: float) -> Pose:
    swing = stride * np.sin(phase)
    left_lift, right_lift = max(np.cos(phase), 0.0), max(-np.cos(phase), 0.0)
    pose: dict[str, tuple[float, float, float]] = {
        "pelvis": (0.10, 0.0, -0.12 * swing),
        "chest": (0.16, 0.0, 0.30 * swing),
        "head": (-0.15, 0.0, -0.15 * swing),
        "upper_arm.left": (0.70 * swing - 0.10, -0.22, 0.0),
        "upper_arm.right": (-0.60 * swing - 0.10, 0.30, 0.0),
        "forearm.left": (-1.45, 0.0, 0.25),
        "forearm.right": (-1.20, 0.0, -0.15),
        "hand.right": (-0.55, 0.0, 0.0),
    }
    for side, forward, lift in (("left", swing, left_lift), ("right", -swing, right_lift)):
        thigh, knee = -0.80 * forward - 0.18, 0.28 + 1.0 * lift
        pose[f"thigh.{side}"] = thigh, 0.0, 0.0
        pose[f"shin.{side}"] = knee, 0.0, 0.0
        pose[f"foot.{side}"] = -0.7 * (thigh + knee), 0.0, 0.0
    return pose


def _mixed(first: Pose, second: Pose, share: float) -> Pose:
    """`share` of the second pose and the rest of the first; bones in neither stay at rest."""
    mixed = {}
    for bone in skeleton():
        one, other = (np.array(pose.get(bone, (0.0, 0.0, 0.0))) for pose in (first, second))
        x, y, z = (1 - share) * one + share * other
        mixed[bone] = float(x), float(y), float(z)
    return mixed
