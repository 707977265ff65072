"""What clips show, as ranges: players' places, cameras' heights, distances, pitches and lenses."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from small_world import box_of, camera, small_clips

from pe_runtime.contract.envelope import ENVELOPE_KEY, Envelope
from pe_runtime.curation.envelope import envelope_of, envelope_of_clips, known_envelope
from pe_runtime.geometry.cameras import Cameras

PLACES = [(x, y, 0.0) for x in (-1.0, 0.0, 2.0) for y in (-0.5, 1.0)]


def frames(distances=(5.0, 6.0, 7.0), places=PLACES):
    """One frame per camera and place, of one player."""
    views = [camera(0.1, distance=each) for each in distances for _ in places]
    boxes = [
        box_of(place, view) for view, place in zip(views, places * len(distances), strict=True)
    ]
    return Cameras.stack(views), torch.tensor(np.array(boxes))[:, None].float()


def test_ranges_hold_all_that_was_seen_and_little_more():
    found = envelope_of(*frames())
    for (low, high), truth in (
        ((found.positions[0][0], found.positions[1][0]), (-1.0, 2.0)),
        ((found.positions[0][1], found.positions[1][1]), (-0.5, 1.0)),
        (found.camera_heights, (1.6, 1.6)),
    ):
        assert truth[0] - 0.4 < low < truth[0] and truth[1] < high < truth[1] + 0.4
    low, high = found.camera_distances
    assert 3.5 < low < 5.0 and 7.0 < high < 10.0
    slopes = [math.degrees(math.atan2(-1.1, each)) for each in (5.0, 7.0)]
    low, high = found.camera_pitches
    assert slopes[0] - 2 < low < slopes[0] and slopes[1] < high < slopes[1] + 2
    angle = math.degrees(2 * math.atan(0.5))
    assert found.fields_of_view == pytest.approx((angle - 1, angle + 1), abs=1e-3)


def test_single_slips_say_nothing():
    cameras, boxes = frames(distances=(5.0,) * 60)
    before = envelope_of(cameras, boxes)
    boxes[7, 0] = torch.tensor([0.0, 0.0, 1.0, 18.0])
    after = envelope_of(cameras, boxes)
    assert after.positions[1][1] < before.positions[1][1] + 0.5
    assert after.box_heights[1] < before.box_heights[1] + 0.05


def test_players_who_are_not_seen_are_not_counted():
    cameras, boxes = frames()
    half = boxes.clone()
    half[::2] = torch.nan
    both = torch.cat([boxes, torch.full_like(boxes, torch.nan)], dim=1)
    assert envelope_of(cameras, both) == envelope_of(cameras, boxes)
    assert envelope_of(cameras, half).positions[0][1] > envelope_of(cameras, boxes).positions[0][1]


def test_clips_without_any_player_have_no_envelope():
    clips = small_clips()
    empty = replace(clips, boxes=torch.full_like(clips.boxes, torch.nan))
    assert envelope_of_clips(empty) is None and known_envelope(empty) == {}


def test_the_header_entry_of_clips_is_their_envelope():
    clips = small_clips()
    entry = known_envelope(clips)[ENVELOPE_KEY]
    assert Envelope.from_dict(entry) == envelope_of_clips(clips)
    heights = [(b[3] - b[1]) / clips.images.shape[2] for b in clips.boxes.reshape(-1, 4).tolist()]
    assert entry["box_heights"][0] < min(heights) and max(heights) < entry["box_heights"][1]
