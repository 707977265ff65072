"""The laws of the data of `duel`, without Blender."""

import numpy as np
import pytest

from blender_addon.datagen import motion, viewpoints
from blender_addon.datagen.motion import ACTIONS, PLAYERS, draw_sequence, move
from blender_addon.datagen.viewpoints import camera_axes, ground_axes

LEFT, RIGHT, FORWARD, BACK = (ACTIONS.index(a) for a in ("left", "right", "forward", "back"))
IDLE, RAISE = ACTIONS.index("idle"), ACTIONS.index("raise_arm")


@pytest.fixture(scope="module")
def plans():
    return [draw_sequence(5, number) for number in range(60)]


def steps(plans):
    """(plan, t, player, action, displacement) of every step."""
    for plan in plans:
        for t, player in np.ndindex(plan.motion.actions.shape):
            moved = plan.motion.positions[t + 1, player] - plan.motion.positions[t, player]
            yield plan, t, player, int(plan.motion.actions[t, player]), moved


def test_a_step_follows_its_action_in_the_camera_of_that_moment(plans):
    for plan, t, _, action, moved in steps(plans):
        right, forward = ground_axes(plan.views[0][t])
        along = {LEFT: -right, RIGHT: right, FORWARD: forward, BACK: -forward}.get(action)
        if along is None:
            np.testing.assert_array_equal(moved, 0)
        else:
            length = moved @ along
            np.testing.assert_allclose(moved, length * along, atol=1e-12)
            assert 0.30 * 0.92 - 1e-9 <= length <= 0.30 * 1.08 + 1e-9


def test_forward_leads_away_from_the_camera_and_right_to_the_right_of_the_picture(plans):
    view = plans[0].views[0][0]
    eye, axes = view.eye, camera_axes(view)
    ahead, beside = move(FORWARD, view), move(RIGHT, view)
    assert np.linalg.norm((ahead - eye)[:2]) > np.linalg.norm(eye[:2])
    assert beside @ axes[:, 0] == pytest.approx(0.30)


def test_camera_axes_are_a_rotation_that_looks_at_the_target(plans):
    for view in plans[0].views[1]:
        axes = camera_axes(view)
        np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
        assert np.linalg.det(axes) == pytest.approx(1)
        toward = (view.target - view.eye) @ axes
        np.testing.assert_allclose(toward[:2], 0, atol=1e-9)
        assert toward[2] > 0
        assert axes[2, 1] < 0, "the picture's y axis points down"


def test_players_stay_on_the_court_and_apart(plans):
    for plan in plans:
        feet = plan.motion.positions
        assert np.abs(feet[..., 0]).max() <= 3.2
        assert np.abs(feet[..., 1]).max() <= 2.0
        assert not feet[..., 2].any()
        assert np.linalg.norm(feet[:, 0] - feet[:, 1], axis=-1).min() >= 1.0 - 1e-9


def test_players_start_left_and_right(plans):
    for plan in plans:
        first, second = plan.motion.positions[0]
        assert -2.6 <= first[0] <= -0.6
        assert 0.6 <= second[0] <= 2.6
        assert np.abs([first[1], second[1]]).max() <= 1.5


def test_the_first_camera_sees_both_players_whole_and_large_enough(plans):
    for plan in plans:
        for view, feet in zip(plan.views[0], plan.motion.positions, strict=True):
            for foot in feet:
                assert viewpoints.shows_person(view, foot)


def test_a_person_out_of_the_picture_or_far_away_is_not_shown(plans):
    view = plans[0].views[0][0]
    right, forward = ground_axes(view)
    assert not viewpoints.shows_person(view, 6 * right)
    assert not viewpoints.shows_person(view, 8 * forward)
    assert viewpoints.shows_person(view, np.zeros(3))


def test_cameras_keep_to_their_ranges_and_move_smoothly(plans):
    for plan in plans:
        azimuths = [azimuth(path) for path in plan.views]
        for path, turned in zip(plan.views, azimuths, strict=True):
            eyes = np.array([view.eye for view in path])
            distance = np.linalg.norm(eyes[:, :2], axis=1)
            assert np.abs(turned).max() <= 25 + 1e-9
            assert 7.5 - 1e-9 <= distance.min() <= distance.max() <= 9.5 + 1e-9
            assert 1.8 - 1e-9 <= eyes[:, 2].min() <= eyes[:, 2].max() <= 3.5 + 1e-9
            assert np.abs(np.diff(turned)).max() <= 3 + 1e-9
            assert 48 <= np.degrees(path[0].field_of_view) <= 52


def test_the_second_camera_stands_8_to_20_degrees_beside_the_first(plans):
    for plan in plans:
        apart = np.abs(azimuth(plan.views[1]) - azimuth(plan.views[0]))
        assert 8 - 1e-9 <= apart.min() <= apart.max() <= 20 + 1e-9


def azimuth(path):
    return np.array([np.degrees(np.arctan2(view.eye[0], -view.eye[1])) for view in path])


def test_every_action_is_common(plans):
    chosen = np.bincount(
        np.concatenate([plan.motion.actions.ravel() for plan in plans]), minlength=len(ACTIONS)
    )
    assert chosen.min() / chosen.sum() > 0.08


def test_most_actions_are_held_for_two_to_five_steps(plans):
    runs = [
        length for plan in plans for actions in plan.motion.actions.T for length in held(actions)
    ]
    assert np.mean([2 <= length <= 5 for length in runs]) > 0.85


def held(actions):
    """Lengths of the runs of equal actions, without the last, which the sequence cuts off."""
    borders = np.flatnonzero(np.diff(actions)) + 1
    return np.diff([0, *borders])


def test_the_arm_is_up_right_after_raising_and_comes_down_afterwards(plans):
    for plan, t, player, action, _ in steps(plans):
        lift = plan.motion.gaits[player].lift
        expected = 1.0 if action == RAISE else motion.ARM_DECAY * lift[t]
        assert lift[t + 1] == pytest.approx(expected)


def test_limbs_swing_while_walking_and_rest_while_idle(plans):
    walking, idle = [], []
    for plan, t, player, action, _ in steps(plans):
        previous = plan.motion.actions[max(t - 1, 0), player]
        legs = abs(plan.motion.gaits[player].leg[t + 1])
        if action == previous == IDLE and t > 1:
            idle.append(legs)
        if action in (LEFT, RIGHT, FORWARD, BACK) and previous == action:
            walking.append(legs)
    assert np.mean(walking) > 3 * np.mean(idle)
    assert 0.35 < np.max(walking) <= motion.LEG_SWING * 1.1


def test_people_turn_toward_where_they_walk_but_never_away_from_the_camera(plans):
    yaw = {LEFT: [], RIGHT: []}
    for plan, t, player, action, _ in steps(plans):
        gait = plan.motion.gaits[player]
        assert np.abs(gait.yaw).max() <= motion.LARGEST_TURN
        if action in yaw and t and plan.motion.actions[t - 1, player] == action:
            yaw[action].append(gait.yaw[t + 1])
    # A yaw above 0 turns a person who faces -Y towards +X, the picture's right.
    assert np.mean(yaw[RIGHT]) > 0.25
    assert np.mean(yaw[LEFT]) < -0.25


def test_a_sequence_depends_on_seed_and_number_only():
    again = [draw_sequence(5, 3) for _ in range(2)]
    np.testing.assert_array_equal(again[0].motion.positions, again[1].motion.positions)
    assert again[0].rng.random() == again[1].rng.random()
    for other in (draw_sequence(5, 4), draw_sequence(6, 3)):
        assert not np.array_equal(again[0].motion.positions, other.motion.positions)


def test_two_players_without_room_are_refused_rather_than_moved(plans, monkeypatch):
    monkeypatch.setattr(motion, "MINIMUM_GAP", 50.0)
    monkeypatch.setattr(motion, "_ATTEMPTS", 3)
    with pytest.raises(motion.NoRoomError, match="no legal sequence"):
        draw_sequence(0, 0)


def test_there_are_as_many_start_ranges_as_players():
    assert len(motion.START_X) == len(PLAYERS)


def test_nobody_stands_in_front_of_the_other_players_feet(plans):
    for plan in plans:
        for view, feet in zip(plan.views[0], plan.motion.positions, strict=True):
            in_camera = (feet - view.eye) @ camera_axes(view)
            across = in_camera[:, 0] / in_camera[:, 2]
            assert abs(across[0] - across[1]) * in_camera[:, 2].min() >= 0.25 - 1e-9


def test_feet_behind_a_person_are_hidden_and_beside_one_are_seen(plans):
    view = plans[0].views[0][0]
    right, forward = ground_axes(view)
    toward = view.eye * (1, 1, 0) / 4
    assert viewpoints.hides_feet(view, np.stack([toward, np.zeros(3)]))
    assert not viewpoints.hides_feet(view, np.stack([toward + right, np.zeros(3)]))


@pytest.mark.parametrize("frames", [12, 17, 30])
def test_sequences_can_be_longer_than_usual(frames):
    plan = draw_sequence(3, 1, frames)
    assert plan.motion.positions.shape == (frames, 2, 3)
    assert plan.motion.actions.shape == (frames - 1, 2)
    assert all(len(path) == frames for path in plan.views)
