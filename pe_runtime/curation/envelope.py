"""What a data set shows, as ranges: where players stand and cameras look from.

Places come from boxes and cameras, as the encoder finds them, so that recordings of which nobody
knows the truth have an envelope too.
"""

import math
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from pe_runtime.contract.envelope import ENVELOPE_KEY, Envelope, Span
from pe_runtime.dataset import Clips
from pe_runtime.geometry.cameras import Cameras, ground_from_pixels

SHARE = 0.005
"""Of all values, so many are left out at either end: single slips say nothing."""
SLACK = 0.05
"""Ranges are widened by this share of themselves at either end, and at least by a little."""


def envelope_of_clips(clips: Clips) -> Envelope | None:
    """The ranges of clips; None if no player is ever seen."""
    height, width = clips.images.shape[2:4]
    intrinsics, poses = (each.flatten(0, 1) for each in (clips.intrinsics, clips.world_from_camera))
    return envelope_of(Cameras(width, height, intrinsics, poses), clips.boxes.flatten(0, 1))


def known_envelope(clips: Clips) -> dict[str, Any]:
    """The entry of a model file's header that holds the envelope; empty if there is none."""
    found = envelope_of_clips(clips)
    return {} if found is None else {ENVELOPE_KEY: found.as_dict()}


def envelope_of(cameras: Cameras, boxes: Float[Tensor, "frames players 4"]) -> Envelope | None:
    """The ranges of frames; None if no player is ever seen.

    Args:
        cameras: Camera of each frame.
        boxes: Left, top, right, bottom in pixels; NaN where a player is not seen.
    """
    boxes = boxes.double()
    feet = torch.stack([(boxes[..., 0] + boxes[..., 2]) / 2, boxes[..., 3]], dim=-1)
    places, stands = ground_from_pixels(cameras, feet.nan_to_num())
    seen = stands & boxes.isfinite().all(dim=-1)
    if not seen.any():
        return None
    players = seen.sum(dim=1)
    middles = (places * seen[..., None]).sum(dim=1) / players.clamp(min=1)[:, None]
    distances = (middles - cameras.centres).norm(dim=-1)[players > 0]
    x, y = (_span(places[seen][:, axis], 0.1) for axis in (0, 1))
    rises = cameras.rotations[:, 2, 2].clamp(-1, 1).asin()
    angles = 2 * torch.atan(cameras.width / 2 / cameras.intrinsics[:, 0, 0])
    heights = (boxes[..., 3] - boxes[..., 1])[seen] / cameras.height
    return Envelope(
        positions=((x[0], y[0]), (x[1], y[1])),
        camera_heights=_span(cameras.centres[:, 2], 0.1),
        camera_distances=_span(distances, 0.1),
        camera_pitches=_span(rises.rad2deg(), 1.0),
        fields_of_view=_span(angles.rad2deg(), 1.0),
        box_heights=_span(heights, 0.01),
    )


def _span(values: Float[Tensor, " values"], least: float) -> Span:
    """Lowest and highest value, without the extremes and a little wider."""
    ends = values.new_tensor([SHARE, 1 - SHARE])
    low, high = torch.quantile(_few(values.double()), ends.double()).tolist()
    wider = max(SLACK * (high - low), least)
    return round(low - wider, 3), round(high + wider, 3)


def _few(values: Tensor, most: int = 1 << 20) -> Tensor:
    """Evenly chosen values, as many as `torch.quantile` takes."""
    return values[:: math.ceil(len(values) / most)]
