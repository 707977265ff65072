"""Random actions of people who share a ground: drawn, held for a while, always legal.

Pure numpy. World: metres, Z up. An action moves a person in the directions of the main camera at
that moment, projected on the ground.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from blender_addon.datagen.viewpoints import Viewpoint, ground_axes

HOLD_STEPS = (2, 5)  # inclusive
STEP_SPREAD = 0.08  # share of a step's length

Legal = Callable[[np.ndarray, int, Viewpoint], bool]


class NoRoomError(RuntimeError):
    """No legal step exists; the caller draws the sequence anew."""


@dataclass(frozen=True, eq=False)
class Rules:
    """What may happen in a scene.

    Attributes:
        players: Names of the people.
        directions: (actions, 2) to the right of the picture and away from the camera, in steps.
        step_metres: Length of a step.
        legal: Whether all `feet` (players, 3) are, the given player having moved last, seen from
            a viewpoint.
    """

    players: tuple[str, ...]
    directions: np.ndarray
    step_metres: float
    legal: Legal


@dataclass
class _Choice:
    """The action a player holds and for how many more steps."""

    action: int = 0
    remaining: int = 0


def displacement(rules: Rules, action: int, view: Viewpoint, length: float) -> np.ndarray:
    """Displacement (3,) in metres of one step of `action` seen from `view`."""
    right, forward = ground_axes(view)
    sideways, away = rules.directions[action]
    return length * (sideways * right + away * forward)


def walk(
    rng: np.random.Generator, rules: Rules, start: np.ndarray, views: list[Viewpoint]
) -> tuple[np.ndarray, np.ndarray]:
    """Draw everybody's actions, legal at every frame of `views`.

    Args:
        rng: Where the draws come from.
        rules: The scene's.
        start: (players, 3) first ground points in metres.
        views: The main camera, frame by frame.

    Returns:
        (frames - 1, players) int8 actions and (frames, players, 3) positions.

    Raises:
        NoRoomError: A player ran into a corner from which no action is legal.
    """
    frames, players = len(views), len(rules.players)
    positions = np.zeros((frames, players, 3))
    actions = np.zeros((frames - 1, players), dtype=np.int8)
    positions[0] = start
    choices = [_Choice() for _ in range(players)]
    for t in range(frames - 1):
        positions[t + 1] = positions[t]
        for player, choice in enumerate(choices):
            step = _next_step(rng, rules, choice, (positions[t + 1], player), views[t : t + 2])
            actions[t, player] = choice.action
            positions[t + 1, player] += step
    return actions, positions


def _next_step(
    rng: np.random.Generator,
    rules: Rules,
    choice: _Choice,
    place: tuple[np.ndarray, int],
    views: list[Viewpoint],
) -> np.ndarray:
    """Keep the held action where it is legal, else draw another; returns its displacement."""
    feet, player = place
    length = rules.step_metres * (1 + rng.uniform(-STEP_SPREAD, STEP_SPREAD))
    order = list(rng.permutation(len(rules.directions)))
    hold = int(rng.integers(HOLD_STEPS[0], HOLD_STEPS[1] + 1))
    if choice.remaining > 0:
        order.insert(0, choice.action)
    elif order[0] == choice.action:
        order.append(order.pop(0))
    for rank, action in enumerate(order):
        step = displacement(rules, int(action), views[0], length)
        moved = feet.copy()
        moved[player] += step
        if rules.legal(moved, player, views[1]):
            kept = choice.remaining > 0 and rank == 0
            choice.remaining = choice.remaining - 1 if kept else hold - 1
            choice.action = int(action)
            return step
    raise NoRoomError(f"{rules.players[player]} cannot move and cannot stay")
