"""What one recorded sequence says about a model: its pictures and its players' tracks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pe_runtime.contract.episode import Episode
from pe_runtime.evaluation.exchange import Donor, exchange_figures
from pe_runtime.evaluation.motion import camera_relative_movements, position_errors
from pe_runtime.evaluation.poses import pose_figures
from pe_runtime.evaluation.subject import (
    NOVEL_VIEW,
    RECORDED_VIEW,
    Evaluated,
    cameras_of,
    can_be_followed,
    encoded,
    mean_told,
    picture_of,
    positions_of,
    roll_out,
)
from pe_runtime.evaluation.visual import psnr, ssim
from pe_runtime.state import EnvironmentState


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


def measure(
    environment: Evaluated, episode: Episode, number: int, every: int, donor: Donor | None = None
) -> Measured:
    """Encode every frame, draw each n-th, follow the players.

    Args:
        environment: The model.
        episode: The sequence.
        number: Its position in the data set.
        every: Draw each so many frames.
        donor: Another sequence, whose poses and styles are tried on; None leaves that out.
    """
    frames = episode.arrays.frames
    states = [encoded(environment, episode, frame) for frame in range(frames)]
    drawn = [_figures(environment, episode, states, frame) for frame in range(0, frames, every)]
    if donor is not None:
        # Half as often: it takes four frames to draw where the others take one.
        for index in range(0, len(drawn), 2):
            at = index * every
            drawn[index] |= exchange_figures(environment, episode, states[at], at, donor)
    keys = dict.fromkeys(key for each in drawn for key in each)
    visual = {key: mean_told([each[key] for each in drawn if key in each]) for key in keys}
    tracks = {}
    if can_be_followed(environment, episode):
        tracks = _follow(environment, episode, states)
    return Measured(number, visual, len(drawn), tracks)


def _figures(
    environment: Evaluated, episode: Episode, states: Sequence[EnvironmentState], frame: int
) -> dict[str, float]:
    """Visual figures of one frame."""
    reference = picture_of(episode, RECORDED_VIEW, frame)
    state, camera = states[frame], episode.camera(RECORDED_VIEW, frame)
    picture = environment.render(state, camera).rgb
    figures = {
        "reconstruction_psnr": psnr(picture, reference),
        "reconstruction_ssim": ssim(picture, reference),
    }
    if episode.arrays.views > NOVEL_VIEW:
        novel = picture_of(episode, NOVEL_VIEW, frame)
        view = environment.render(state, episode.camera(NOVEL_VIEW, frame)).rgb
        figures["novel_view_psnr"] = psnr(view, novel)
        figures["novel_view_ssim"] = ssim(view, novel)
        figures["novel_view_drop"] = figures["reconstruction_psnr"] - psnr(view, novel)
    if environment.playable_names:
        figures |= pose_figures(environment, episode, states, frame, picture)
    return figures


def _follow(
    environment: Evaluated, episode: Episode, states: Sequence[EnvironmentState]
) -> dict[str, Track]:
    """Motion of every player in a sequence that shows all of them all the time."""
    cameras = cameras_of(episode)
    inferred = environment.infer_actions(states, cameras)
    played = roll_out(environment, states[0], inferred, cameras)
    return tracks_of(episode, states, inferred, played)


def tracks_of(
    episode: Episode,
    states: Sequence[EnvironmentState],
    inferred: Mapping[str, np.ndarray],
    played: Sequence[EnvironmentState],
) -> dict[str, Track]:
    """What a sequence's states and their rollout say about each player's motion.

    Args:
        episode: The sequence.
        states: Encoded from every frame.
        inferred: Actions by player.
        played: The first state and what follows from the actions.
    """
    arrays, names = episode.arrays, episode.info.objects
    moves = camera_relative_movements(arrays.positions, arrays.world_from_camera[RECORDED_VIEW])
    seen, rolled = positions_of(states, names), positions_of(played, names)
    still = np.broadcast_to(seen[:1], seen.shape)
    errors = [position_errors(each, arrays.positions) for each in (seen, rolled, still)]
    return {
        name: Track(
            moves[:, index],
            np.asarray(inferred[name]),
            arrays.actions[:, index],
            *(each[:, index] for each in errors),
        )
        for index, name in enumerate(names)
    }
