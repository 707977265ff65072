"""What is evaluated: the verbs asked of a model, and what a recorded sequence feeds it."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.episode import Episode
from pe_runtime.environment import RenderOptions
from pe_runtime.images import read_image
from pe_runtime.state import EnvironmentState

RECORDED_VIEW, NOVEL_VIEW = 0, 1


@runtime_checkable
class Evaluated(Protocol):
    """What is asked of a model; `PlayableEnvironment` has it."""

    playable_names: tuple[str, ...]
    actions: Mapping[str, Any]  # by class of object; empty before the second training phase
    action_names: Mapping[str, tuple[str, ...]]  # by player; one name for each action, or none

    def encode(
        self, image: np.ndarray, camera: Camera, boxes: Mapping[str, Sequence[float]]
    ) -> EnvironmentState:
        """See `PlayableEnvironment.encode`."""

    def step(
        self,
        state: EnvironmentState,
        actions: Mapping[str, int],
        camera: Camera,
        memory: Any = None,  # noqa: ANN401 the model's own
    ) -> tuple[EnvironmentState, Any]:
        """See `PlayableEnvironment.step`."""

    def infer_actions(
        self, states: Sequence[EnvironmentState], cameras: Sequence[Camera]
    ) -> dict[str, np.ndarray]:
        """See `PlayableEnvironment.infer_actions`."""

    def render(
        self, state: EnvironmentState, camera: Camera, options: RenderOptions | None = None
    ) -> Any:  # noqa: ANN401 a Frame
        """See `PlayableEnvironment.render`."""


def picture_of(episode: Episode, view: int, frame: int) -> np.ndarray:
    """The recorded picture, (height, width, 3) float32 in [0, 1]."""
    return read_image(episode.frame_path(view, frame))


def boxes_of(episode: Episode, frame: int, view: int = RECORDED_VIEW) -> dict[str, tuple]:
    """Boxes of the players that are in a view, by name; (left, top, right, bottom) pixels."""
    present = episode.arrays.present[view, frame]
    boxes = episode.arrays.boxes[view, frame].tolist()
    return {
        name: tuple(box)
        for name, box, seen in zip(episode.info.objects, boxes, present, strict=True)
        if seen
    }


def encoded(environment: Evaluated, episode: Episode, frame: int) -> EnvironmentState:
    """The state of one recorded frame; boxes of players the model does not have are left out."""
    boxes = boxes_of(episode, frame)
    known = {name: box for name, box in boxes.items() if name in environment.playable_names}
    camera = episode.camera(RECORDED_VIEW, frame)
    return environment.encode(picture_of(episode, RECORDED_VIEW, frame), camera, known)


def cameras_of(episode: Episode, view: int = RECORDED_VIEW) -> list[Camera]:
    """The cameras of one view, one per frame."""
    return [episode.camera(view, frame) for frame in range(episode.arrays.frames)]


def acts(environment: Evaluated) -> bool:
    """Whether the model has players, and actions for them."""
    return bool(environment.actions) and bool(environment.playable_names)


def can_be_followed(environment: Evaluated, episode: Episode) -> bool:
    """Whether the players move, are all seen in every frame, and the model has actions."""
    in_view = bool(episode.arrays.present[RECORDED_VIEW].all())
    return episode.arrays.frames > 1 and in_view and acts(environment)


def roll_out(
    environment: Evaluated,
    start: EnvironmentState,
    actions: Mapping[str, np.ndarray],
    cameras: Sequence[Camera],
) -> list[EnvironmentState]:
    """The start and the states that follow when the actions are played along the cameras."""
    states, memory = [start], None
    for step, camera in enumerate(cameras[:-1]):
        chosen = {name: int(track[step]) for name, track in actions.items()}
        state, memory = environment.step(states[-1], chosen, camera, memory)
        states.append(state)
    return states


def positions_of(states: Sequence[EnvironmentState], names: Sequence[str]) -> np.ndarray:
    """(time, objects, 3) float64 metres."""
    rows = [[state[name].position.detach().cpu().numpy() for name in names] for state in states]
    return np.array(rows, dtype=np.float64).reshape(len(states), len(names), 3)


def mean_told(values: Sequence[float]) -> float:
    """Mean of the values that could be told; NaN if none could."""
    told = [float(value) for value in values if not math.isnan(value)]
    return sum(told) / len(told) if told else math.nan
