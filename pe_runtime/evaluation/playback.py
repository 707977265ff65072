"""A recorded sequence as a model shows it again, under the paper's three protocols.

reconstruction   every frame's own state, drawn from the camera that recorded it
playability      the first frame's state and the actions inferred over the sequence, rolled out
camera           the same, drawn from the second camera; a model without actions shows every
frame's own state there, and says so
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pe_runtime.contract.episode import Episode
from pe_runtime.contract.errors import ConfigError
from pe_runtime.evaluation.detection import FrameDetections
from pe_runtime.evaluation.instruments import Instruments
from pe_runtime.evaluation.rules import RULES
from pe_runtime.evaluation.subject import (
    NOVEL_VIEW,
    RECORDED_VIEW,
    Evaluated,
    acts,
    cameras_of,
    can_be_followed,
    encoded,
    picture_of,
    roll_out,
)
from pe_runtime.evaluation.visual import psnr, ssim
from pe_runtime.state import EnvironmentState

MODES = ("reconstruction", "playability", "camera")


@dataclass(frozen=True)
class Prepared:
    """A sequence read by a model, before anything is drawn.

    Attributes:
        states: Of every recorded frame.
        inferred: Actions by player; empty if the model has none or a player leaves the view.
        played: The first state and what follows from the actions; empty where there are none.
    """

    states: Sequence[EnvironmentState]
    inferred: Mapping[str, np.ndarray]
    played: Sequence[EnvironmentState]


@dataclass(frozen=True)
class Shown:
    """A sequence shown again, reduced to what the figures need. T frames.

    Attributes:
        pairs: Mean of each figure of a pair of pictures (psnr, ssim, lpips_r, lpips).
        frames: (T, features) of the drawn and of the recorded pictures, by kind of feature.
        clips: (clips, features) likewise.
        detections: Of each frame, in order; empty without a detector.
    """

    pairs: dict[str, float]
    frames: dict[str, tuple[np.ndarray, np.ndarray]]
    clips: dict[str, tuple[np.ndarray, np.ndarray]]
    detections: tuple[FrameDetections, ...]


def prepare(environment: Evaluated, episode: Episode) -> Prepared:
    """Encode every frame; infer and play the actions where the model has any."""
    states = [encoded(environment, episode, frame) for frame in range(episode.arrays.frames)]
    if not can_be_followed(environment, episode):
        return Prepared(states, {}, [])
    cameras = cameras_of(episode)
    inferred = environment.infer_actions(states, cameras)
    return Prepared(states, inferred, roll_out(environment, states[0], inferred, cameras))


def scheduled(
    mode: str, environment: Evaluated, episode: Episode, prepared: Prepared
) -> tuple[Sequence[EnvironmentState], int] | None:
    """The states that a protocol draws and the view it draws them from.

    Returns:
        None where a sequence cannot serve: a player leaves the view, or there is no second view.

    Raises:
        ConfigError: Playability is asked of a model without actions, or there is no such protocol.
    """
    if mode == "reconstruction":
        return prepared.states, RECORDED_VIEW
    if mode == "playability":
        if not acts(environment):
            raise ConfigError(
                "playability needs a model with trained actions; this one has its synthesis "
                "module only: train them with `pe train actions`"
            )
        return (prepared.played, RECORDED_VIEW) if prepared.played else None
    if mode != "camera":
        raise ConfigError(f"protocol must be one of {', '.join(MODES)}, found {mode!r}")
    states = prepared.played if acts(environment) else prepared.states
    return (states, NOVEL_VIEW) if states and episode.arrays.views > NOVEL_VIEW else None


def show(
    environment: Evaluated,
    episode: Episode,
    states: Sequence[EnvironmentState],
    view: int,
    instruments: Instruments,
) -> Shown:
    """Draw states from the cameras of a view and compare them with what it recorded.

    Args:
        environment: The model.
        episode: The sequence.
        states: One per frame.
        view: Whose cameras and pictures.
        instruments: What is measured with.
    """
    drawn, recorded, detections = [], [], []
    for frame in range(0, len(states), RULES.every):
        options = instruments.options(environment.playable_names)
        rendered = environment.render(states[frame], episode.camera(view, frame), options)
        picture = picture_of(episode, view, frame)
        detections += instruments.detections(rendered, picture, episode, (view, frame))
        drawn.append(np.asarray(rendered.rgb, dtype=np.float32))
        recorded.append(picture)
    pairs = {
        "psnr": np.mean([psnr(a, b) for a, b in zip(drawn, recorded, strict=True)]),
        "ssim": np.mean([ssim(a, b) for a, b in zip(drawn, recorded, strict=True)]),
    }
    for name, distance in instruments.distances().items():
        pairs[name] = np.mean([distance(a, b) for a, b in zip(drawn, recorded, strict=True)])
    both = np.stack(drawn), np.stack(recorded)
    return Shown(
        {name: float(value) for name, value in pairs.items()},
        {name: (of(both[0]), of(both[1])) for name, of in instruments.of_frames().items()},
        {name: (of(both[0]), of(both[1])) for name, of in instruments.of_clips().items()},
        tuple(detections),
    )
