"""Delta-MSE, Delta-Acc, mutual information and position errors against hand numbers."""

import math

import numpy as np
import pytest
from toy_world import camera

from pe_runtime.evaluation.motion import (
    camera_relative_movements,
    delta_accuracy,
    delta_mse,
    normalised_mutual_information,
    position_errors,
    standing_accuracy,
    standing_actions,
    with_standing_merged,
)

MOVES = np.array([[0.0, 0.0], [0.0, 2.0], [4.0, 0.0], [4.0, 2.0]])


def test_actions_that_fix_the_movement_have_no_delta_mse():
    assert delta_mse(MOVES, np.array([3, 1, 0, 2])) == 0.0


def test_one_action_for_everything_has_a_delta_mse_of_one_hundred():
    assert delta_mse(MOVES, np.array([1, 1, 1, 1])) == pytest.approx(100.0)


def test_delta_mse_by_hand():
    # Actions know the 4 m step (variance 4) and not the 2 m one (variance 1).
    assert delta_mse(MOVES, np.array([0, 0, 1, 1])) == pytest.approx(20.0)


def test_delta_mse_does_not_care_about_names_units_or_a_common_drift():
    rng = np.random.default_rng(0)
    moves, actions = rng.normal(size=(50, 2)), rng.integers(0, 4, 50)
    expected = delta_mse(moves, actions)
    assert delta_mse(moves, 9 - actions) == pytest.approx(expected)
    assert delta_mse(100 * moves, actions) == pytest.approx(expected)
    assert delta_mse(moves + 3, actions) == pytest.approx(expected)


def test_delta_mse_cannot_be_told_without_movement_or_samples():
    assert math.isnan(delta_mse(np.ones((5, 2)), np.arange(5)))
    assert math.isnan(delta_mse(np.zeros((0, 2)), np.zeros(0, dtype=int)))


def samples(spread, count=400):
    rng = np.random.default_rng(1)
    actions = rng.integers(0, 4, count)
    centres = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])
    return centres[actions] + rng.normal(0, spread, (count, 2)), actions, np.arange(count) // 10


def test_separate_movements_tell_their_actions():
    assert delta_accuracy(*samples(0.02)) == 100.0


def test_movements_drowned_in_noise_tell_actions_no_better_than_guessing():
    assert delta_accuracy(*samples(50.0)) == pytest.approx(25.0, abs=6.0)


def test_delta_accuracy_never_learns_from_the_sequence_it_is_asked_about():
    # Each sequence has its own movement: only a look at itself could tell its action.
    sequence = np.repeat(np.arange(6), 20)
    moves = np.stack([10.0 * sequence, np.zeros(120)], axis=1)
    assert delta_accuracy(moves, sequence, sequence) == 0.0


def test_delta_accuracy_of_one_sequence_cannot_be_told():
    assert math.isnan(delta_accuracy(MOVES, np.arange(4), np.zeros(4, dtype=int)))


def test_labels_that_agree_up_to_names_share_all_information():
    a = np.array([0, 0, 1, 1, 2, 2])
    assert normalised_mutual_information(a, np.array([7, 7, 3, 3, 5, 5])) == pytest.approx(1.0)


def test_independent_labels_share_no_information():
    a, b = np.array([0, 0, 1, 1]), np.array([0, 1, 0, 1])
    assert normalised_mutual_information(a, b) == pytest.approx(0.0, abs=1e-12)


def test_mutual_information_by_hand():
    # H(a) = log 2, H(b) = 0: nothing in common. And a is split in two by b: 2 log 2 / 3 log 2.
    a = np.array([0, 0, 1, 1])
    assert normalised_mutual_information(a, np.zeros(4, dtype=int)) == 0.0
    assert normalised_mutual_information(a, np.arange(4)) == pytest.approx(2 / 3)


def test_mutual_information_of_constants_is_one_and_of_nothing_unknown():
    assert normalised_mutual_information(np.zeros(3, dtype=int), np.ones(3, dtype=int)) == 1.0
    assert math.isnan(normalised_mutual_information(np.zeros(0, int), np.zeros(0, int)))


def test_position_errors_are_distances_on_the_ground():
    predicted = np.array([[[3.0, 4.0, 9.0]], [[0.0, 0.0, 0.0]]])
    assert position_errors(predicted, np.zeros((2, 1, 3))).tolist() == [[5.0], [0.0]]


@pytest.mark.parametrize("azimuth", [0.0, 0.7, -2.0, np.pi])
def test_walking_away_from_any_camera_is_forward(azimuth):
    view = camera(azimuth)
    forward = view.world_from_camera[:3, 2]
    positions = np.stack([np.zeros(3), forward, forward])[:, None]
    moves = camera_relative_movements(positions, np.stack([view.world_from_camera] * 3))
    np.testing.assert_allclose(moves[:, 0], [[0, 1], [0, 0]], atol=1e-12)


def test_each_movement_is_seen_by_the_camera_of_its_first_frame():
    cameras = np.stack([camera(0.0).world_from_camera, camera(np.pi / 2).world_from_camera] * 2)
    positions = np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0], [2.0, 0, 0]])[:, None]
    moves = camera_relative_movements(positions, cameras)
    np.testing.assert_allclose(moves[:, 0], [[1, 0], [0, -1], [0, 0]], atol=1e-12)


def test_standing_actions_are_merged_and_walking_ones_are_not():
    moves = np.array([[0.0, 0.01], [0.3, 0.0], [0.02, 0.0], [0.0, -0.3]])
    actions = np.array([4, 1, 2, 0])
    assert standing_actions(moves, actions) == [2, 4]
    assert with_standing_merged(moves, actions).tolist() == [2, 1, 2, 0]


def test_merged_standing_actions_can_be_told_from_movements_that_do_not_tell_them_apart():
    rng = np.random.default_rng(3)
    actions = rng.integers(0, 3, 300)
    moves = np.array([[0.0, 0], [0, 0], [0.3, 0]])[actions] + rng.normal(0, 0.01, (300, 2))
    sequence = np.arange(300) // 10
    assert delta_accuracy(moves, actions, sequence) < 85
    assert delta_accuracy(moves, with_standing_merged(moves, actions), sequence) == 100


def standing(inferred_of):
    """True actions 0 (idle), 1 (arm), 2 (walk) over ten sequences, idle three times as often."""
    true = np.tile([0, 0, 0, 1, 2], 20)
    moves = np.array([[0.0, 0], [0, 0], [0.3, 0]])[true]
    inferred = np.array([inferred_of(t, i) for i, t in enumerate(true)])
    return standing_accuracy(moves, inferred, true, np.arange(100) // 10)


def test_standing_actions_with_names_of_their_own_are_told_apart():
    assert standing(lambda true, index: 7 - true) == 100.0


def test_standing_actions_that_share_one_name_are_told_apart_by_guessing_only():
    assert standing(lambda true, index: 5 * (true == 2)) == 50.0


def test_two_names_for_the_same_standing_action_do_no_harm():
    assert standing(lambda true, index: 9 + index % 2 if true == 0 else true) == 100.0


def test_one_way_of_standing_leaves_nothing_to_tell_apart():
    true, moves = np.zeros(40, dtype=int), np.zeros((40, 2))
    assert math.isnan(standing_accuracy(moves, true, true, np.arange(40) // 10))
