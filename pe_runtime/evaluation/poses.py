"""What pose codes are worth: the picture of a player in its own pose and in another frame's."""

from collections.abc import Iterable, Sequence

import numpy as np

from pe_runtime.contract.episode import Episode
from pe_runtime.evaluation.displacement import put_back
from pe_runtime.evaluation.subject import RECORDED_VIEW, Evaluated, boxes_of, picture_of
from pe_runtime.evaluation.visual import box_mask, psnr
from pe_runtime.state import EnvironmentState, repose


def pose_figures(
    environment: Evaluated,
    episode: Episode,
    states: Sequence[EnvironmentState],
    frame: int,
    own_picture: np.ndarray,
) -> dict[str, float]:
    """PSNR in players' boxes: own pose, another frame's, and that one put where the own one is.

    Args:
        environment: The model.
        episode: The sequence.
        states: Of all its frames.
        frame: Which one is drawn.
        own_picture: The frame as it was drawn from its own state.
    """
    state, camera = states[frame], episode.camera(RECORDED_VIEW, frame)
    reference = picture_of(episode, RECORDED_VIEW, frame)
    mask = box_mask(list(boxes_of(episode, frame).values()), *reference.shape[:2])
    other = other_frame(frame, len(states))
    both = boxes_of(episode, frame).keys() & boxes_of(episode, other).keys()
    names = sorted(both & set(environment.playable_names))
    swapped = with_poses(state, states[other], names)
    matched = swapped
    for name in names:
        matched = put_back(environment, matched, state, name)
    own = psnr(own_picture, reference, mask)
    others = psnr(environment.render(swapped, camera).rgb, reference, mask)
    left = psnr(environment.render(matched, camera).rgb, reference, mask)
    return {
        "box_psnr_own_pose": own,
        "box_psnr_other_pose": others,
        "box_psnr_pose_gap": own - others,
        "box_psnr_articulation_gap": own - left,
    }


def other_frame(frame: int, frames: int) -> int:
    """Half a sequence away: the frame whose pose has the least to do with this one's."""
    return (frame + frames // 2) % frames


def with_poses(
    state: EnvironmentState, source: EnvironmentState, names: Iterable[str]
) -> EnvironmentState:
    """The state with the named players' poses of another."""
    for name in names:
        state = repose(state, name, source[name].pose)
    return state
