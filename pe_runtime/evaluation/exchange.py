"""Codes of another sequence tried on: its poses move limbs, its styles change colours alone."""

import math
from collections.abc import Callable, Iterable

import numpy as np

from pe_runtime.contract.episode import Episode
from pe_runtime.environment import RenderOptions
from pe_runtime.evaluation.displacement import put_back
from pe_runtime.evaluation.poses import with_poses
from pe_runtime.evaluation.rules import RULES
from pe_runtime.evaluation.subject import (
    RECORDED_VIEW,
    Evaluated,
    boxes_of,
    encoded,
    mean_told,
    picture_of,
)
from pe_runtime.evaluation.visual import box_mask, psnr
from pe_runtime.state import EnvironmentState, restyle

OPAQUE = RULES.opaque
"""Share of a pixel above which it counts as the object's."""


Silhouette = Callable[[np.ndarray], np.ndarray]


class Donor:
    """A sequence that lends its codes.

    Args:
        environment: The model.
        episode: The sequence; frames are encoded when they are asked for.
        silhouette: Finds the pixels of people in a picture, if there is such a thing.
    """

    def __init__(
        self, environment: Evaluated, episode: Episode, silhouette: Silhouette | None = None
    ) -> None:
        self.environment, self.episode, self.silhouette = environment, episode, silhouette

    def lent(self, frame: int) -> tuple[EnvironmentState, set[str]]:
        """The state of a frame, or of the last one, and the players it shows."""
        frame = min(frame, self.episode.arrays.frames - 1)
        seen = boxes_of(self.episode, frame).keys() & set(self.environment.playable_names)
        return encoded(self.environment, self.episode, frame), seen


def exchange_figures(
    environment: Evaluated, episode: Episode, state: EnvironmentState, frame: int, donor: Donor
) -> dict[str, float]:
    """What the donor's poses and styles change in one frame.

    Poses are tried on without the shift they bring (see `put_back`).

    Returns:
        `other_sequence_pose_psnr_gap`: dB in players' boxes lost to the recorded picture;
        `other_sequence_pose_change`: mean absolute change of colour in the boxes, in percent of
        full range; `other_sequence_pose_iou`: of the players' masks before and after;
        `style_swap_iou`: of their masks before and after the styles, 1 by construction where
        density does not depend on style; `style_swap_silhouette_iou`: of what the detector takes
        for people in the two pictures; `style_swap_colour`: mean absolute change of colour on the
        players, in percent. Empty if no player is in both.
    """
    lent, seen = donor.lent(frame)
    names = sorted(boxes_of(episode, frame).keys() & seen)
    if not names:
        return {}
    camera = episode.camera(RECORDED_VIEW, frame)
    options = RenderOptions(masks=tuple(names))
    reference = picture_of(episode, RECORDED_VIEW, frame)
    inside = box_mask(list(boxes_of(episode, frame).values()), *reference.shape[:2])
    posed = with_poses(state, lent, names)
    for name in names:
        posed = put_back(environment, posed, state, name)
    own, other, restyled = (
        environment.render(each, camera, options)
        for each in (state, posed, with_styles(state, lent, names))
    )
    shown = [own.masks[name] > OPAQUE for name in names]
    outlines = {}
    if donor.silhouette is not None:
        before, after = donor.silhouette(own.rgb), donor.silhouette(restyled.rgb)
        outlines["style_swap_silhouette_iou"] = mask_iou(before, after)
    return outlines | {
        "other_sequence_pose_psnr_gap": psnr(own.rgb, reference, inside)
        - psnr(other.rgb, reference, inside),
        "other_sequence_pose_change": colour_change(own.rgb, other.rgb, inside),
        "other_sequence_pose_iou": _mean_iou(shown, [other.masks[n] > OPAQUE for n in names]),
        "style_swap_iou": _mean_iou(shown, [restyled.masks[n] > OPAQUE for n in names]),
        "style_swap_colour": colour_change(own.rgb, restyled.rgb, np.any(shown, axis=0)),
    }


def with_styles(
    state: EnvironmentState, source: EnvironmentState, names: Iterable[str]
) -> EnvironmentState:
    """The state with the named players' styles of another."""
    for name in names:
        state = restyle(state, name, source[name].style)
    return state


def mask_iou(a: np.ndarray, b: np.ndarray) -> float:
    """Pixels in both over pixels in either; NaN if there are none."""
    either = int((a | b).sum())
    return float((a & b).sum()) / either if either else math.nan


def colour_change(a: np.ndarray, b: np.ndarray, mask: np.ndarray) -> float:
    """Mean absolute difference of the masked pixels in percent of full range; NaN without any."""
    return 100.0 * float(np.abs(a[mask] - b[mask]).mean()) if mask.any() else math.nan


def _mean_iou(before: list[np.ndarray], after: list[np.ndarray]) -> float:
    return mean_told([mask_iou(a, b) for a, b in zip(before, after, strict=True)])
