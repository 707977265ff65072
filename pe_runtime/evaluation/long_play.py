"""Two hundred steps of play: does a model stay with what it has learnt, or drift into nonsense?

Scripts start from the first frame of recorded sequences. Held scripts repeat one action for every
player, random ones change it every few steps. The camera stays where the first frame was taken.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from pe_runtime.contract.episode import Episode
from pe_runtime.contract.errors import ConfigError, EpisodeError
from pe_runtime.environment import RenderOptions
from pe_runtime.evaluation.confidence import Figure, bootstrap_mean
from pe_runtime.evaluation.pose_movement import (
    EncodedPoses,
    distance_from_mean,
    encoded_poses,
    liveliness,
    pose_codes,
)
from pe_runtime.evaluation.rules import LONG_PLAY, RULES
from pe_runtime.evaluation.subject import (
    RECORDED_VIEW,
    Evaluated,
    acts,
    can_be_followed,
    encoded,
    mean_told,
    positions_of,
    roll_out,
)
from pe_runtime.state import EnvironmentState

LONG_PLAY_FIGURES = {
    "finite": ("States and pictures that are finite", "%"),
    "steady_speed": ("Held actions whose late speed is the early one", "%"),
    "speed_change": ("Difference of late and early speed, held actions", "m/step"),
    "farthest_per_step": ("Distance walked per step at most, any script", "m/step"),
    "height_error": ("Greatest distance of feet from the floor", "m"),
    "pose_deviation": ("Pose codes, late: deviation from encoded ones (encoded: 1)", ""),
    "pose_deviation_most": ("The same at its greatest", ""),
    "liveliness": ("Movement of pose codes in late walking over that of encoded walking", ""),
}
"""Label and unit of each figure."""


@dataclass(frozen=True)
class Played:
    """One script played to its end.

    Attributes:
        action: The action held, or None for a random script.
        states: The start and every step after it.
    """

    action: int | None
    states: Sequence[EnvironmentState]


def long_play(
    environment: Evaluated,
    episodes: Iterable[Episode],
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Figure]:
    """Play held and random scripts from the starts of some sequences; see `LONG_PLAY_FIGURES`.

    Args:
        environment: A model with actions.
        episodes: Recorded sequences; the first few that show all players are played on.
        progress: Called with (starts done, starts in all).

    Raises:
        ConfigError: The model has no actions.
        EpisodeError: No sequence shows all players all the time.
    """
    if not acts(environment) or action_count(environment) == 0:
        raise ConfigError("long play needs a model with trained actions: `pe train actions`")
    usable = [episode for episode in episodes if can_be_followed(environment, episode)]
    if not usable:
        raise EpisodeError("long play needs a sequence that shows all players in every frame")
    known = encoded_poses(environment, usable, walking_actions(environment, usable[0]))
    starts, figures = usable[: LONG_PLAY.starts], []
    for number, episode in enumerate(starts):
        played = list(scripts(environment, episode, RULES.seed + number))
        figures.append(_figures(environment, episode, played, known))
        if progress is not None:
            progress(number + 1, len(starts))
    return {key: bootstrap_mean([each[key] for each in figures]) for key in LONG_PLAY_FIGURES}


def scripts(environment: Evaluated, episode: Episode, seed: int) -> Iterator[Played]:
    """Every action held, and one random script, from the first frame on."""
    start = encoded(environment, episode, 0)
    cameras = [episode.camera(RECORDED_VIEW, 0)] * (LONG_PLAY.steps + 1)
    count = action_count(environment)
    for action in range(count):
        held = dict.fromkeys(environment.playable_names, np.full(LONG_PLAY.steps, action))
        yield Played(action, roll_out(environment, start, held, cameras))
    rng = np.random.default_rng(seed)
    tracks = {name: random_script(rng, count) for name in environment.playable_names}
    yield Played(None, roll_out(environment, start, tracks, cameras))


def random_script(rng: np.random.Generator, actions: int) -> np.ndarray:
    """(steps,) actions, each held for a few steps."""
    low, high = LONG_PLAY.hold
    track: list[int] = []
    while len(track) < LONG_PLAY.steps:
        track += [int(rng.integers(actions))] * int(rng.integers(low, high + 1))
    return np.array(track[: LONG_PLAY.steps])


def action_count(environment: Evaluated) -> int:
    """How many actions every player has."""
    return min(len(environment.action_names[name]) for name in environment.playable_names)


def walking_actions(environment: Evaluated, episode: Episode) -> list[int]:
    """The actions that move players by more than the slowest walk when held for a while."""
    start = encoded(environment, episode, 0)
    cameras = [episode.camera(RECORDED_VIEW, 0)] * (LONG_PLAY.early + 1)
    names, found = environment.playable_names, []
    for action in range(action_count(environment)):
        held = dict.fromkeys(names, np.full(LONG_PLAY.early, action))
        positions = positions_of(roll_out(environment, start, held, cameras), names)
        if speeds(positions).mean() > RULES.slowest_walk:
            found.append(action)
    return found


def speeds(positions: np.ndarray) -> np.ndarray:
    """(steps, objects) metres walked on the ground in each step."""
    return np.linalg.norm(np.diff(positions[..., :2], axis=0), axis=-1)


def _figures(
    environment: Evaluated, episode: Episode, played: Sequence[Played], known: EncodedPoses
) -> dict[str, float]:
    """Figures of all scripts from one start."""
    names, late = environment.playable_names, slice(LONG_PLAY.late, None)
    places = [positions_of(each.states, names) for each in played]
    walked = [speeds(each) for each in places]
    held = [speed for each, speed in zip(played, walked, strict=True) if each.action is not None]
    changes = np.abs([speed[late].mean(0) - speed[: LONG_PLAY.early].mean(0) for speed in held])
    deviations, lively = [], []
    for each, speed in zip(played, walked, strict=True):
        for index, name in enumerate(names):
            codes = known.in_deviations(name, pose_codes(each.states[late], name))
            deviations.append(distance_from_mean(codes))
            if each.action is not None:
                walk = np.where(speed[late, index] > RULES.slowest_walk, each.action, -1)
                lively.append(liveliness(codes[:-1], walk))
    every = np.concatenate(deviations)
    return {
        "finite": 100.0 * float(np.mean([_is_finite(environment, episode, p) for p in played])),
        "steady_speed": 100.0 * float(np.mean(changes <= LONG_PLAY.speed_margin)),
        "speed_change": float(changes.mean()),
        "farthest_per_step": max(float(speed.max()) for speed in walked),
        "height_error": max(float(np.abs(p[..., 2] - p[:1, :, 2]).max()) for p in places),
        "pose_deviation": float(every.mean()),
        "pose_deviation_most": float(every.max()),
        "liveliness": mean_told(lively) / known.liveliness,
    }


def _is_finite(environment: Evaluated, episode: Episode, played: Played) -> bool:
    """Whether all states are, and the pictures at the start, in the middle and at the end."""
    every = [each for state in played.states for each in state.objects.values()]
    codes = [code for each in every for code in (each.position, each.style, each.pose)]
    if not all(bool(code.isfinite().all()) for code in codes):
        return False
    camera, options = episode.camera(RECORDED_VIEW, 0), RenderOptions("draft")
    looked_at = islice(played.states, 0, None, len(played.states) // 2)
    pictures = [environment.render(state, camera, options).rgb for state in looked_at]
    return all(bool(np.isfinite(picture).all()) for picture in pictures)
