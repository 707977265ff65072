"""What one recorded sequence says about a model: its pictures and its players' tracks."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.episode import Episode
from pe_runtime.evaluation.motion import camera_relative_movements, position_errors
from pe_runtime.evaluation.visual import box_mask, psnr, ssim
from pe_runtime.images import read_image
from pe_runtime.state import EnvironmentState, repose

RECORDED_VIEW, NOVEL_VIEW = 0, 1


@runtime_checkable
class Evaluated(Protocol):
    """What is asked of a model; `PlayableEnvironment` has it."""

    playable_names: tuple[str, ...]
    actions: Mapping[str, Any]  # by class of object; empty before the second training phase

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

    def render(self, state: EnvironmentState, camera: Camera) -> Any:  # noqa: ANN401 a Frame
        """See `PlayableEnvironment.render`."""


@dataclass(frozen=True)
class Track:
    """One player's movement through one sequence of T frames.

    Attributes:
        moves: (T - 1, 2) true movement on the ground, metres right and forward of the camera.
        inferred: (T - 1,) actions the model read off the pictures.
        true: (T - 1,) actions the recorder carried out; -1 if unknown.
        encoded_errors: (T,) metres from each encoded position to the true one.
        rollout_errors: (T,) the same when only frame 0 was seen and `inferred` was played.
        static_errors: (T,) the same for a player who stays where frame 0 showed it.
    """

    moves: np.ndarray
    inferred: np.ndarray
    true: np.ndarray
    encoded_errors: np.ndarray
    rollout_errors: np.ndarray
    static_errors: np.ndarray


@dataclass(frozen=True)
class Measured:
    """What one sequence contributes.

    Attributes:
        number: Position of the sequence in the data set.
        visual: Mean of each visual figure over the frames drawn.
        frames: How many frames were drawn.
        tracks: By player; empty if a player leaves the picture, if there is one frame only, or
            if the model has no actions yet.
    """

    number: int
    visual: dict[str, float]
    frames: int
    tracks: dict[str, Track]


def measure(environment: Evaluated, episode: Episode, number: int, every: int) -> Measured:
    """Encode every frame, draw each n-th, follow the players.

    Args:
        environment: The model.
        episode: The sequence.
        number: Its position in the data set.
        every: Draw each so many frames.
    """
    frames = episode.arrays.frames
    states = [_encode(environment, episode, frame) for frame in range(frames)]
    drawn = [_draw(environment, episode, states, frame) for frame in range(0, frames, every)]
    visual = {key: mean_told([each[key] for each in drawn]) for key in drawn[0]}
    in_view = bool(episode.arrays.present[RECORDED_VIEW].all())
    followed = frames > 1 and in_view and bool(environment.actions)
    tracks = _follow(environment, episode, states) if followed else {}
    return Measured(number, visual, len(drawn), tracks)


def _encode(environment: Evaluated, episode: Episode, frame: int) -> EnvironmentState:
    picture = read_image(episode.frame_path(RECORDED_VIEW, frame))
    camera = episode.camera(RECORDED_VIEW, frame)
    return environment.encode(picture, camera, _boxes(episode, frame))


def _boxes(episode: Episode, frame: int) -> dict[str, tuple[float, ...]]:
    """Boxes of the players that are in the recorded view, by name."""
    present = episode.arrays.present[RECORDED_VIEW, frame]
    boxes = episode.arrays.boxes[RECORDED_VIEW, frame].tolist()
    return {
        name: tuple(box)
        for name, box, seen in zip(episode.info.objects, boxes, present, strict=True)
        if seen
    }


def _draw(
    environment: Evaluated, episode: Episode, states: Sequence[EnvironmentState], frame: int
) -> dict[str, float]:
    """Visual figures of one frame."""
    state, camera = states[frame], episode.camera(RECORDED_VIEW, frame)
    reference = read_image(episode.frame_path(RECORDED_VIEW, frame))
    boxes = _boxes(episode, frame)
    mask = box_mask(list(boxes.values()), *reference.shape[:2])
    # Half a sequence away: the frame whose pose has the least to do with this one's.
    other = (frame + len(states) // 2) % len(states)
    swapped = _with_poses(state, states[other], boxes.keys() & _boxes(episode, other).keys())
    own_picture = environment.render(state, camera).rgb
    other_picture = environment.render(swapped, camera).rgb
    own, others = psnr(own_picture, reference, mask), psnr(other_picture, reference, mask)
    figures = {
        "reconstruction_psnr": psnr(own_picture, reference),
        "reconstruction_ssim": ssim(own_picture, reference),
        "box_psnr_own_pose": own,
        "box_psnr_other_pose": others,
        "box_psnr_pose_gap": own - others,
    }
    if episode.arrays.views > NOVEL_VIEW:
        novel = read_image(episode.frame_path(NOVEL_VIEW, frame))
        view = environment.render(state, episode.camera(NOVEL_VIEW, frame)).rgb
        figures["novel_view_psnr"] = psnr(view, novel)
        figures["novel_view_ssim"] = ssim(view, novel)
        figures["novel_view_drop"] = figures["reconstruction_psnr"] - psnr(view, novel)
    return figures


def _with_poses(
    state: EnvironmentState, source: EnvironmentState, names: set[str]
) -> EnvironmentState:
    for name in sorted(names):
        state = repose(state, name, source[name].pose)
    return state


def _follow(
    environment: Evaluated, episode: Episode, states: Sequence[EnvironmentState]
) -> dict[str, Track]:
    """Motion of every player in a sequence that shows all of them all the time."""
    arrays, names = episode.arrays, episode.info.objects
    cameras = [episode.camera(RECORDED_VIEW, frame) for frame in range(arrays.frames)]
    inferred = environment.infer_actions(states, cameras)
    moves = camera_relative_movements(arrays.positions, arrays.world_from_camera[RECORDED_VIEW])
    encoded = _positions(states, names)
    played = _positions(_roll_out(environment, states[0], inferred, cameras), names)
    still = np.broadcast_to(encoded[:1], encoded.shape)
    errors = [position_errors(each, arrays.positions) for each in (encoded, played, still)]
    return {
        name: Track(
            moves[:, index],
            np.asarray(inferred[name]),
            arrays.actions[:, index],
            *(each[:, index] for each in errors),
        )
        for index, name in enumerate(names)
    }


def _roll_out(
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


def _positions(states: Sequence[EnvironmentState], names: Sequence[str]) -> np.ndarray:
    """(time, objects, 3) float64 metres."""
    rows = [[state[name].position.detach().cpu().numpy() for name in names] for state in states]
    return np.array(rows, dtype=np.float64).reshape(len(states), len(names), 3)


def mean_told(values: Sequence[float]) -> float:
    """Mean of the values that could be told; NaN if none could."""
    told = [float(value) for value in values if not math.isnan(value)]
    return sum(told) / len(told) if told else math.nan
