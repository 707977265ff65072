"""What the players of `court` and `static-court` do, and where the cameras stand: pure numpy.

World: metres, Z up, the net along x at y = 0. The near player looks away from the cameras at -Y,
the far player at them.
"""

from dataclasses import dataclass

import numpy as np

from blender_addon.datagen.athlete_motion import Movement, Words, draw_movement
from blender_addon.datagen.broadcast import fixed_views, plan_broadcast
from blender_addon.datagen.viewpoints import Viewpoint, hides_feet, shows_person
from blender_addon.datagen.walk import Legal, NoRoomError, Rules, walk

ACTIONS = ("idle", "left", "right", "forward", "back", "swing")
PLAYERS = ("player_far", "player_near")
LONE_PLAYER = ("player_near",)
STEPS_PER_SECOND = 5.0
FRAMES = 12

STEP_METRES = 0.45
ROAM_X = {"player_far": (-2.9, 2.9), "player_near": (-2.7, 2.7)}
ROAM_Y = {"player_far": (1.7, 4.3), "player_near": (-4.7, -1.9)}
SMALLEST_PLAYER = 28 / 144  # of the picture's height

_ATTEMPTS = 2000
_REACH, _TOP = 0.7, 2.0  # metres: half the width, and the height, that stay in the picture
_DIRECTIONS = np.array([(0, 0), (-1, 0), (1, 0), (0, 1), (0, -1), (0, 0)], dtype=np.float64)
_WORDS = Words(_DIRECTIONS, ACTIONS.index("swing"))


@dataclass(frozen=True)
class Rally:
    """One sequence before it is built.

    Attributes:
        players: Their names.
        actions: (frames - 1, players) index into `ACTIONS`, taken from frame t to t + 1.
        positions: (frames, players, 3) ground points in metres.
        movements: What the bodies do, one entry per player.
        views: The two cameras' viewpoints, one per frame each.
        rng: Where the sequence's further draws (colours) come from.
    """

    players: tuple[str, ...]
    actions: np.ndarray
    positions: np.ndarray
    movements: tuple[Movement, ...]
    views: tuple[list[Viewpoint], list[Viewpoint]]
    rng: np.random.Generator


def draw_rally(seed: int, sequence: int, static: bool = False, frames: int = FRAMES) -> Rally:
    """Draw one sequence; the same numbers give the same plan in every process.

    Args:
        seed: Of the data set.
        sequence: Number of the episode.
        static: One player before a camera that never moves.
        frames: Of the episode.
    """
    rng = np.random.default_rng((seed, sequence))
    players = LONE_PLAYER if static else PLAYERS
    rules = Rules(players, _DIRECTIONS, STEP_METRES, _legality(players))
    for _ in range(_ATTEMPTS):
        views = fixed_views(frames) if static else plan_broadcast(rng, frames)
        try:
            start = _start(rng, rules, views[0][0])
            actions, positions = walk(rng, rules, start, views[0])
        except NoRoomError:
            continue
        movements = tuple(
            draw_movement(rng, actions[:, k], _WORDS, faces_camera=name == "player_far")
            for k, name in enumerate(players)
        )
        return Rally(players, actions, positions, movements, views, rng)
    raise NoRoomError(f"no legal rally in {_ATTEMPTS} attempts: seed {seed}, number {sequence}")


def _start(rng: np.random.Generator, rules: Rules, view: Viewpoint) -> np.ndarray:
    feet = np.zeros((len(rules.players), 3))
    for k, name in enumerate(rules.players):
        feet[k, :2] = rng.uniform(*ROAM_X[name]), rng.uniform(*ROAM_Y[name])
    if not all(rules.legal(feet, k, view) for k in range(len(feet))):
        raise NoRoomError("the start lies outside the picture")
    return feet


def _legality(players: tuple[str, ...]) -> Legal:
    def legal(feet: np.ndarray, player: int, view: Viewpoint) -> bool:
        name, (x, y, _) = players[player], feet[player]
        low, high = np.transpose([ROAM_X[name], ROAM_Y[name]])
        if not (low[0] <= x <= high[0] and low[1] <= y <= high[1]):
            return False
        if len(players) > 1 and hides_feet(view, feet):
            return False
        return shows_person(view, feet[player], SMALLEST_PLAYER, _REACH, _TOP)

    return legal
