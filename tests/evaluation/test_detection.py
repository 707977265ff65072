"""ADD and MDR against hand numbers, the matching behind them, and boxes of silhouettes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pe_runtime.evaluation.detection import (
    HistogramDetector,
    average_detection_distance,
    compare,
    held_against,
    match,
    missing_detection_rate,
    relative_detection_distance,
)
from pe_runtime.evaluation.detector_network import component_boxes


def box(x, y, half=5.0):
    return (x - half, y - half, x + half, y + half)


def test_add_and_mdr_by_hand():
    # Two people found again 3 and 5 pixels off, then one of two lost.
    first = held_against([box(20, 20), box(70, 20)], [box(73, 24), box(20, 23)], 100)
    second = held_against([box(20, 20), box(70, 20)], [box(20, 20)], 100)
    assert sorted(first.distances) == [3.0, 5.0]
    frames = [first, second]
    assert average_detection_distance(frames) == pytest.approx(8 / 3)
    assert relative_detection_distance(frames) == pytest.approx(8 / 3)
    assert missing_detection_rate(frames) == pytest.approx(25.0)


def test_people_who_cross_are_matched_by_where_they_are():
    pairs = match([box(20, 20), box(60, 20)], [box(58, 20), box(23, 20)], 100)
    assert [(pair.reference, pair.found) for pair in pairs] == [(0, 1), (1, 0)]


def test_the_sum_of_distances_counts_and_not_the_nearest_pair():
    # Greedily 0 takes the one at 24 (2 off) and leaves 13 for the other.
    pairs = match([box(22, 20), box(25, 20)], [box(24, 20), box(12, 20)], 100)
    assert [(pair.reference, pair.found) for pair in pairs] == [(0, 1), (1, 0)]


def test_whoever_is_too_far_away_is_somebody_else():
    frame = held_against([box(10, 20)], [box(31, 20)], 100)
    assert frame.distances == ()
    assert missing_detection_rate([frame]) == 100.0
    assert math.isnan(average_detection_distance([frame]))


def test_a_pair_that_is_too_far_does_not_keep_another_from_its_partner():
    pairs = match([box(10, 20), box(90, 20)], [box(28, 20)], 100)
    assert [(pair.reference, pair.found) for pair in pairs] == [(0, 0)]


def test_people_who_were_never_recorded_are_no_mistake_and_nobody_cannot_be_told():
    frame = held_against([], [box(31, 20)], 100)
    assert math.isnan(missing_detection_rate([frame]))
    assert match([box(1, 1)], [], 100) == []


places = st.lists(st.tuples(st.floats(0, 100), st.floats(0, 100)), max_size=5)


@given(wanted=places, found=places)
def test_matches_are_one_to_one_and_within_reach(wanted, found):
    pairs = match([box(*p) for p in wanted], [box(*p) for p in found], 100)
    assert len({pair.reference for pair in pairs}) == len({pair.found for pair in pairs})
    assert len(pairs) <= min(len(wanted), len(found))
    assert all(pair.distance <= 20.0 for pair in pairs)


@given(wanted=places, shift=st.floats(-5, 5))
def test_a_common_shift_is_found_again_whoever_comes_first(wanted, shift):
    boxes = [box(*p) for p in wanted]
    frame = held_against(boxes, [box(x + shift, y) for x, y in reversed(wanted)], 100)
    if boxes:
        assert missing_detection_rate([frame]) == 0.0
        assert average_detection_distance([frame]) <= abs(shift) + 1e-9


def test_a_detector_looks_at_both_pictures():
    class Bright:
        name = "bright"

        def __call__(self, picture):
            return component_boxes(picture[..., 0] > 0.5)

    recorded, drawn = np.zeros((2, 40, 60, 3), np.float32)
    recorded[10:20, 10:16] = 1.0
    drawn[10:20, 14:20] = 1.0
    frame = compare(Bright(), drawn, recorded)
    assert (frame.distances, frame.recorded, frame.width) == ((4.0,), 1, 60)


def test_silhouettes_give_boxes_largest_first_and_specks_give_none():
    mask = np.zeros((60, 80), dtype=bool)
    mask[10:20, 5:10] = True
    mask[30:50, 40:52] = True
    mask[0, 79] = True
    assert component_boxes(mask) == [(40.0, 30.0, 52.0, 50.0), (5.0, 10.0, 10.0, 20.0)]


def test_a_hand_that_a_gap_of_a_pixel_cuts_off_belongs_to_its_body():
    mask = np.zeros((60, 80), dtype=bool)
    mask[10:20, 5:10] = True
    mask[10:14, 12:14] = True
    assert component_boxes(mask) == [(5.0, 10.0, 14.0, 20.0)]
    assert component_boxes(np.zeros_like(mask)) == []


def test_the_histogram_detector_finds_nobody_in_an_empty_picture():
    assert HistogramDetector()(np.full((48, 64, 3), 0.4, np.float32)) == []
