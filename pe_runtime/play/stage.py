"""The stage: all that stays as it is while somebody plays."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.shot import QUALITIES, Start, StyleMix
from pe_runtime.play.camera_moves import resized_camera
from pe_runtime.play.learnt_actions import Learnt, LearntAction, resting_action
from pe_runtime.shots.rollout import World, start_state
from pe_runtime.state import EnvironmentState


@dataclass(frozen=True)
class Wishes:
    """What a player may choose about the frames.

    Attributes:
        fps: Frames per second; None for one per step of the model.
        size: Width and height, pixels; None for the picture's.
        quality: "exact", "balanced" or "draft".
        styles: Player -> the style it wears.
    """

    fps: float | None = None
    size: tuple[int, int] | None = None
    quality: str = "exact"
    styles: Mapping[str, StyleMix] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.fps is not None and not (math.isfinite(self.fps) and self.fps > 0):
            raise ShotError(f"fps: expected a finite number above 0, found {self.fps}")
        if self.quality not in QUALITIES:
            raise ShotError(
                f"quality: expected one of {', '.join(QUALITIES)}, found {self.quality!r}"
            )


@dataclass(frozen=True)
class Stage:
    """Model, picture and choices, with what follows from them.

    Attributes:
        model: Name or path of the model, as shots store it.
        start: The picture or state that a take begins with.
        camera: The camera before any move, at the size of the frames.
        pivot: (3,) what the camera moves about, world, metres.
        state: What the start holds.
        actions: Actions of each player in the picture, in the model's order.
        resting: What each of them does while another one is played.
        fps: Frames per second.
        steps_per_second: Rate of the model.
        wishes: Quality and styles.
    """

    model: str
    start: Start
    camera: Camera
    pivot: np.ndarray
    state: EnvironmentState
    actions: Learnt
    resting: Mapping[str, int]
    fps: float
    steps_per_second: float
    wishes: Wishes

    @property
    def players(self) -> tuple[str, ...]:
        """Who can be played."""
        return tuple(self.actions)

    def names(self, player: str) -> tuple[str, ...]:
        """What the actions of a player are called."""
        return tuple(each.name for each in self.actions[player])


def set_stage(
    world: World,
    model: str,
    start: tuple[Start, Camera],
    learnt: Mapping[str, tuple[LearntAction, ...]],
    wishes: Wishes,
) -> Stage:
    """Read the start and find out what can be played.

    Args:
        world: The loaded environment.
        model: Its name or path.
        start: What a take begins with, and the camera that films.
        learnt: Actions of all its playable objects.
        wishes: What was chosen.

    Raises:
        ShotError: The start cannot be read or holds no player, or a style is of somebody else.
    """
    picture, camera = start
    state = start_state(world, picture)
    camera = camera if wishes.size is None else resized_camera(camera, *wishes.size)
    seen = {n: each for n, each in learnt.items() if n in state.objects and state[n].visible}
    if not seen:
        raise ShotError(
            f"none of {', '.join(learnt)} is in the picture; give their boxes when encoding it"
        )
    for name, mix in wishes.styles.items():
        absent = [each for each in (name, mix.object) if each not in seen]
        if absent:
            raise ShotError(f"style: {absent[0]} is not in the picture, only {', '.join(seen)}")
    resting = {
        name: resting_action(world, state, camera, name, tuple(a.name for a in actions))
        for name, actions in seen.items()
    }
    rate = world.steps_per_second
    pivot = pivot_of(world, state, seen)
    fps = rate if wishes.fps is None else wishes.fps
    return Stage(model, picture, camera, pivot, state, seen, resting, fps, rate, wishes)


def pivot_of(world: World, state: EnvironmentState, players: Iterable[str]) -> np.ndarray:
    """(3,) the middle of the players' feet, raised to the middle of their bodies; world, metres.

    About feet alone, a camera that comes nearer would sink into the ground.
    """
    classes = {each.name: world.config.classes[each.class_name] for each in world.config.objects}
    places = []
    for name in players:
        place = state[name].position.double().numpy().copy()
        if name in classes:
            place[2] += (classes[name].low[2] + classes[name].high[2]) / 2
        places.append(place)
    return np.mean(places, axis=0)
