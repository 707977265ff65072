"""What the two people of `duel` do: random actions and the steps and limb angles they cause.

Pure numpy, so the laws of the data can be tested without Blender. World: metres, Z up; a person
whose yaw is 0 faces -Y, where the cameras are. Angles are radians.
"""

from dataclasses import dataclass

import numpy as np

from blender_addon.datagen.viewpoints import Viewpoint, hides_feet, plan_views, shows_person
from blender_addon.datagen.walk import NoRoomError, Rules, displacement, walk

ACTIONS = ("idle", "left", "right", "forward", "back", "raise_arm")
PLAYERS = ("player_1", "player_2")
STEPS_PER_SECOND = 5.0
FRAMES = 12

STEP_METRES = 0.30
ROAM_X, ROAM_Y = 3.2, 2.0
MINIMUM_GAP = 1.0
START_X = ((-2.6, -0.6), (0.6, 2.6))
START_Y = (-1.5, 1.5)

LEG_SWING, ARM_SWING = 0.42, 0.6
ARM_OVERHEAD = 2.8
ARM_DECAY = 0.25  # share of the raise left after one step: low enough to stay inside 0.8 m
LARGEST_TURN = 0.7

_ATTEMPTS = 2000
_RAISE = ACTIONS.index("raise_arm")
_CAMERA_DIRECTION = np.array([(0, 0), (-1, 0), (1, 0), (0, 1), (0, -1), (0, 0)], dtype=np.float64)


@dataclass(frozen=True)
class Gait:
    """Limb angles of one person, one value per frame (radians; `lift` 0..1)."""

    yaw: np.ndarray
    leg: np.ndarray
    arm: np.ndarray
    lift: np.ndarray
    sway: np.ndarray


@dataclass(frozen=True)
class Motion:
    """Everything that moves on the court in one sequence.

    Attributes:
        actions: (frames - 1, players) index into `ACTIONS`, taken from frame t to t + 1.
        positions: (frames, players, 3) ground points in metres.
        gaits: Limb angles, one entry per player.
    """

    actions: np.ndarray
    positions: np.ndarray
    gaits: tuple[Gait, ...]


@dataclass(frozen=True)
class Plan:
    """One sequence before it is built.

    Attributes:
        motion: What the players do.
        views: The two cameras' paths, one viewpoint per frame each.
        rng: Where the sequence's further draws (colours) come from.
    """

    motion: Motion
    views: tuple[list[Viewpoint], list[Viewpoint]]
    rng: np.random.Generator


def draw_sequence(seed: int, sequence: int, frames: int = FRAMES) -> Plan:
    """Draw one sequence; the same numbers give the same plan in every process."""
    rng = np.random.default_rng((seed, sequence))
    for _ in range(_ATTEMPTS):
        views = plan_views(rng, frames)
        try:
            return Plan(plan_motion(rng, views[0]), views, rng)
        except NoRoomError:
            continue
    raise NoRoomError(f"no legal sequence in {_ATTEMPTS} attempts: seed {seed}, number {sequence}")


def move(action: int, view: Viewpoint, length: float = STEP_METRES) -> np.ndarray:
    """Displacement (3,) in metres of one step of `action` seen from `view`."""
    return displacement(_RULES, action, view, length)


def plan_motion(rng: np.random.Generator, views: list[Viewpoint]) -> Motion:
    """Draw actions for both players, legal at every frame of `views`.

    Raises:
        NoRoomError: A player ran into a corner from which no action is legal.
    """
    actions, positions = walk(rng, _RULES, _start(rng, views[0]), views)
    gaits = tuple(_gait(rng, actions[:, player]) for player in range(len(PLAYERS)))
    return Motion(actions, positions, gaits)


def _start(rng: np.random.Generator, view: Viewpoint) -> np.ndarray:
    feet = np.zeros((len(PLAYERS), 3))
    for player, x_range in enumerate(START_X):
        feet[player, :2] = rng.uniform(*x_range), rng.uniform(*START_Y)
    if not all(_legal(feet, player, view) for player in range(len(PLAYERS))):
        raise NoRoomError("the start lies outside the frame")
    return feet


def _legal(feet: np.ndarray, player: int, view: Viewpoint) -> bool:
    x, y, _ = feet[player]
    others = np.delete(feet, player, axis=0)
    gap = np.linalg.norm(others[:, :2] - feet[player, :2], axis=1).min(initial=np.inf)
    inside = abs(x) <= ROAM_X and abs(y) <= ROAM_Y
    seen = shows_person(view, feet[player]) and not hides_feet(view, feet)
    return bool(inside and gap >= MINIMUM_GAP and seen)


_RULES = Rules(PLAYERS, _CAMERA_DIRECTION, STEP_METRES, _legal)


def _gait(rng: np.random.Generator, actions: np.ndarray) -> Gait:
    """Angles that follow from the actions: frame t shows the state after action t - 1."""
    frames = len(actions) + 1
    phase, cadence = rng.uniform(0, 2 * np.pi), rng.uniform(1.0, 1.7)
    swing, turn = rng.uniform(0.9, 1.1), rng.uniform(0.5, LARGEST_TURN)
    sway_phase, sway_rate = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 0.9)
    wobble = np.clip(rng.normal(0, 0.05, frames), -0.12, 0.12)
    effort = float(rng.random() < 0.5)
    yaw, lift = rng.uniform(-0.3, 0.3), 0.0
    rows = np.zeros((frames, 5))
    for t in range(frames):
        if t > 0:
            action = int(actions[t - 1])
            walking = _CAMERA_DIRECTION[action].any()
            effort += 0.7 * (float(walking) - effort)
            phase += cadence * max(effort, 0.2)
            yaw += 0.5 * (turn * _CAMERA_DIRECTION[action, 0] - yaw)
            lift = 1.0 if action == _RAISE else ARM_DECAY * lift
        idle = 0.06 * np.sin(sway_phase + sway_rate * t)
        heading = np.clip(yaw + wobble[t], -LARGEST_TURN, LARGEST_TURN)
        leg = LEG_SWING * swing * effort * np.sin(phase)
        arm = ARM_SWING * swing * effort * np.sin(phase) + idle
        rows[t] = heading, leg, arm, lift, idle
    return Gait(*rows.T.copy())
