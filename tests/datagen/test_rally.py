"""The laws of the data of `court` and `static-court`, without Blender."""

import numpy as np
import pytest

from blender_addon.datagen import rally
from blender_addon.datagen.athlete_motion import LARGEST_TURN
from blender_addon.datagen.broadcast import FIELD_OF_VIEW, PAN_METRES
from blender_addon.datagen.rally import ACTIONS, PLAYERS, draw_rally
from blender_addon.datagen.viewpoints import camera_axes, ground_axes
from blender_addon.datagen.walk import NoRoomError

FAR, NEAR = range(2)
LEFT, RIGHT, FORWARD, BACK = (ACTIONS.index(a) for a in ("left", "right", "forward", "back"))
SWING = ACTIONS.index("swing")


@pytest.fixture(scope="module")
def rallies():
    return [draw_rally(5, number) for number in range(40)]


@pytest.fixture(scope="module")
def lone():
    return [draw_rally(5, number, static=True) for number in range(20)]


def steps(plans):
    """(plan, t, player, action, displacement) of every step."""
    for plan in plans:
        for t, player in np.ndindex(plan.actions.shape):
            moved = plan.positions[t + 1, player] - plan.positions[t, player]
            yield plan, t, player, int(plan.actions[t, player]), moved


def pixel_heights(plan, player, width=256):
    """Heights of a person of 1.80 m in the first camera, one per frame."""
    for view, feet in zip(plan.views[0], plan.positions, strict=True):
        ends = np.array([feet[player], feet[player] + (0, 0, 1.8)])
        in_camera = (ends - view.eye) @ camera_axes(view)
        rows = 0.5 * width / np.tan(view.field_of_view / 2) * in_camera[:, 1] / in_camera[:, 2]
        yield rows[0] - rows[1]


def test_a_step_follows_its_action_in_the_camera_of_that_moment(rallies, lone):
    for plan, t, _, action, moved in steps(rallies + lone):
        right, forward = ground_axes(plan.views[0][t])
        along = {LEFT: -right, RIGHT: right, FORWARD: forward, BACK: -forward}.get(action)
        if along is None:
            np.testing.assert_array_equal(moved, 0)
        else:
            np.testing.assert_allclose(moved, (moved @ along) * along, atol=1e-12)
            assert 0.45 * 0.92 - 1e-9 <= moved @ along <= 0.45 * 1.08 + 1e-9


def test_each_player_stays_on_the_own_side_of_the_net(rallies):
    for plan in rallies:
        assert plan.positions[:, FAR, 1].min() > 1.6
        assert plan.positions[:, NEAR, 1].max() < -1.8
        assert np.abs(plan.positions[..., 0]).max() <= 2.9


def test_both_players_are_30_to_55_pixels_tall(rallies):
    far, near = (
        [height for plan in rallies for height in pixel_heights(plan, player)]
        for player in (FAR, NEAR)
    )
    assert min(far) >= 28
    assert max(far) < min(near), "the near player looks larger"
    assert max(near) <= 55


def test_the_lone_player_is_larger_still(lone):
    heights = [height for plan in lone for height in pixel_heights(plan, 0)]
    assert 45 < min(heights) < max(heights) < 80


def test_the_main_camera_stays_in_place_and_pans_and_zooms_a_little(rallies):
    panned, zoomed = [], []
    for plan in rallies:
        for path in plan.views:
            eyes = np.array([view.eye for view in path])
            assert np.ptp(eyes, axis=0).max() == 0
            assert eyes[0, 2] > 6.5
            angles = np.degrees([view.field_of_view for view in path])
            assert (
                FIELD_OF_VIEW[0] - 1e-9 <= angles.min() <= angles.max() <= FIELD_OF_VIEW[1] + 1e-9
            )
        targets = np.array([view.target for view in plan.views[0]])
        panned.append(np.ptp(targets[:, 0]))
        zoomed.append(np.ptp(angles))
        assert np.abs(np.diff(targets[:, 0])).max() < PAN_METRES
    assert 0.1 < np.mean(panned) <= 2 * PAN_METRES
    assert np.mean(zoomed) > 0.3


def test_the_second_camera_stands_beside_the_first(rallies):
    for plan in rallies:
        apart = abs(plan.views[1][0].eye - plan.views[0][0].eye)
        assert 1.5 - 1e-9 <= apart[0] <= 3.0 + 1e-9


def test_the_camera_of_the_static_court_never_moves(lone):
    views = [view for plan in lone for view in plan.views[0]]
    for view in views:
        np.testing.assert_array_equal(view.eye, views[0].eye)
        np.testing.assert_array_equal(view.target, views[0].target)
        assert view.field_of_view == views[0].field_of_view
    assert all(plan.players == ("player_near",) for plan in lone)


def test_the_near_player_looks_at_the_net_and_the_far_one_at_the_camera(rallies):
    for plan in rallies:
        far, near = (movement.yaw for movement in plan.movements)
        assert np.abs(far).max() <= LARGEST_TURN
        assert np.abs(near - np.pi).max() <= LARGEST_TURN


@pytest.mark.parametrize("player", [FAR, NEAR])
def test_players_turn_toward_where_they_run(rallies, player):
    looks = {LEFT: [], RIGHT: []}
    for plan, t, k, action, _ in steps(rallies):
        if k == player and action in looks and t and plan.actions[t - 1, k] == action:
            # A player of yaw 0 looks at -Y; yaw grows from there towards +X.
            looks[action].append(np.sin(plan.movements[k].yaw[t + 1]))
    assert np.mean(looks[RIGHT]) > 0.3
    assert np.mean(looks[LEFT]) < -0.3


def test_the_racket_arm_leaves_the_body_when_swinging_and_only_then(rallies):
    hits, rests = [], []
    for plan, t, player, action, _ in steps(rallies):
        earlier = plan.actions[max(t - 2, 0) : t, player]
        raised = abs(plan.movements[player].poses[t + 1]["upper_arm.right"][1])
        if action == SWING and SWING not in earlier:
            hits.append(raised)
        if action != SWING and SWING not in earlier and t >= 2:
            rests.append(raised)
    assert min(hits) > 1.1
    assert max(rests) < 0.6


def test_every_action_is_common(rallies):
    chosen = np.bincount(np.concatenate([p.actions.ravel() for p in rallies]), minlength=6)
    assert chosen.min() / chosen.sum() > 0.08


def test_a_rally_depends_on_seed_and_number_only(rallies):
    again = draw_rally(5, 3)
    np.testing.assert_array_equal(again.positions, rallies[3].positions)
    assert again.movements[1].poses == rallies[3].movements[1].poses
    for other in (draw_rally(5, 4), draw_rally(6, 3)):
        assert not np.array_equal(again.positions, other.positions)


def test_a_court_without_room_is_refused_rather_than_left(monkeypatch):
    monkeypatch.setattr(rally, "SMALLEST_PLAYER", 0.9)
    monkeypatch.setattr(rally, "_ATTEMPTS", 3)
    with pytest.raises(NoRoomError, match="no legal rally"):
        draw_rally(0, 0)


def test_nobody_hides_the_other_players_feet(rallies):
    for plan in rallies:
        for view, feet in zip(plan.views[0], plan.positions, strict=True):
            in_camera = (feet - view.eye) @ camera_axes(view)
            across = in_camera[:, 0] / in_camera[:, 2]
            assert abs(across[0] - across[1]) * in_camera[:, 2].min() >= 0.25 - 1e-9


def test_there_are_places_for_all_players():
    assert set(rally.ROAM_X) == set(rally.ROAM_Y) == set(PLAYERS)
