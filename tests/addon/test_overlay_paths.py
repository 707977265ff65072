"""Paths, step marks, action names and ghosts by hand numbers and by laws."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from blender_addon.overlay.foreseen_paths import (
    MOST_MARKS,
    PAST,
    Foresight,
    Path,
    action_labels,
    colour_of,
    path_lines,
    step_frames,
    step_marks,
)
from blender_addon.overlay.ghosts import (
    Skins,
    ghost_frames,
    ghost_lines,
    heading_arrows,
    present_lines,
)
from blender_addon.overlay.placed_labels import Words, inside, readable
from pe_runtime.contract.model_facts import Volume

BOX = Volume((-0.5, -0.5, 0.0), (0.5, 0.5, 2.0))


def walking(frames=9, now=5, per_step=2.0, **changes):
    """One metre along x for every frame, from frame 1 on."""
    positions = np.stack([np.arange(frames), np.zeros(frames), np.zeros(frames)], axis=1)
    fields = {"name": "player_1", "positions": positions.astype(float), "volume": BOX}
    return Foresight((Path(**(fields | changes)),), 1, now, per_step)


def test_a_path_is_a_line_through_all_frames_and_dimmer_where_it_is_past():
    lines = path_lines(walking())
    (stroke,) = lines.strokes
    assert np.array_equal(stroke.ends[:, 0, 0], np.arange(8))
    assert np.array_equal(stroke.ends[:, 1, 0], np.arange(1, 9))
    assert np.allclose(stroke.colours[:, 3], [PAST] * 4 + [1.0] * 4)
    assert np.array_equal(lines.dots[0].points, [[4.0, 0.0, 0.0]])


@pytest.mark.parametrize(("now", "there"), [(-7, 0.0), (1, 0.0), (9, 8.0), (200, 8.0)])
def test_outside_the_shot_the_object_waits_at_an_end_of_its_path(now, there):
    assert path_lines(walking(now=now)).dots[0].points[0, 0] == there


def test_steps_are_marked_between_frames_where_the_model_steps_there():
    seen = walking(per_step=2.5)
    assert np.allclose(step_frames(seen), [1, 3.5, 6, 8.5])
    assert np.allclose(step_marks(seen).dots[0].points[:, 0], [0, 2.5, 5, 7.5])


def test_a_very_long_shot_has_a_bounded_number_of_marks():
    assert len(step_frames(walking(frames=100_000, per_step=1.0))) <= MOST_MARKS


def test_objects_have_colours_of_their_own():
    assert colour_of(0) != colour_of(1) and colour_of(600) == colour_of(0)


def test_action_names_stand_where_the_action_begins():
    lines = action_labels(walking(keys=[(1, "Left"), (4, "Right"), (40, "Jump")]))
    found = [(each.text, each.anchor[0], each.colour[3]) for each in lines.labels]
    assert found == [("Left", 0.0, PAST), ("Right", 3.0, PAST)]


def test_of_two_actions_at_one_spot_the_later_one_is_named():
    still = np.zeros((9, 3))
    lines = action_labels(walking(positions=still, keys=[(1, "Idle"), (7, "Left")]))
    assert [each.text for each in lines.labels] == ["Left"]
    assert sum(len(each.points) for each in lines.dots) == 2


def test_an_object_stands_in_its_volume_with_its_name_over_it():
    lines = present_lines(walking(now=3))
    assert np.allclose(lines.strokes[0].ends.mean(axis=(0, 1)), [2.0, 0.0, 1.0])
    (name,) = lines.labels
    assert name.text == "player_1" and name.anchor == (2.0, 0.0, 2.0)


def test_ghosts_stand_at_the_steps_around_now():
    frames = ghost_frames(walking(frames=21, now=9), Skins(before=2, after=3, every=1))
    assert [frame for frame, _ in frames] == [5.0, 7.0, 11.0, 13.0, 15.0]
    opacities = dict(frames)
    assert opacities[7.0] > opacities[5.0] and opacities[11.0] > opacities[13.0] > opacities[15.0]


def test_between_two_steps_both_of_them_are_ghosts():
    frames = [frame for frame, _ in ghost_frames(walking(now=4), Skins(before=1, after=1, every=1))]
    assert frames == [3.0, 5.0]


def test_every_second_step_makes_ghosts_twice_as_far_apart():
    frames = ghost_frames(walking(frames=30, now=1), Skins(0, 2, every=2))
    assert [frame for frame, _ in frames] == [5.0, 9.0]


def test_ghosts_end_with_the_shot():
    frames = [frame for frame, _ in ghost_frames(walking(now=7), Skins(before=9, after=9, every=1))]
    assert frames == [1.0, 3.0, 5.0, 9.0]


def test_a_ghost_is_the_volume_at_its_step_turned_as_the_object_will_be():
    turning = np.linspace(0.0, math.pi, 9)
    seen = walking(now=3, headings=turning, volume=Volume((0.0, 0.0, 0.0), (2.0, 1.0, 1.0)))
    lines = ghost_lines(seen, Skins(before=0, after=1, every=1))
    # At frame 5 it stands at x = 4 and has turned by a quarter.
    ends = lines.strokes[0].ends
    assert np.allclose(ends.min(axis=(0, 1)), [3.0, 0.0, 0.0])
    assert np.allclose(ends.max(axis=(0, 1)), [4.0, 2.0, 1.0])


def test_an_object_that_stands_still_has_no_ghosts_and_one_that_turns_on_its_spot_has():
    still, skins = np.zeros((9, 3)), Skins(before=2, after=2, every=1)
    assert ghost_lines(walking(positions=still), skins).segments == 0
    turning = walking(positions=still, headings=np.linspace(0.0, math.pi, 9))
    assert ghost_lines(turning, skins).segments == 4 * 12


def test_ghosts_of_a_slow_object_are_as_far_apart_as_they_can_be_told_apart():
    # One ghost a frame, 4.5 cm each, boxes 1 m wide: every fifth one is more than 20 cm on.
    positions = np.stack([np.arange(40) * 0.045, np.zeros(40), np.zeros(40)], axis=1)
    seen = walking(positions=positions, now=1, per_step=1.0)
    lines = ghost_lines(seen, Skins(before=0, after=24, every=1))
    middles = sorted(each.ends[..., 0].mean() for each in lines.strokes)
    assert np.allclose(middles, [0.225, 0.45, 0.675, 0.9])


def test_objects_that_do_not_turn_have_no_arrow_and_unknown_volumes_no_ghosts():
    assert heading_arrows(walking()) == ghost_lines(walking(volume=None), Skins())
    assert heading_arrows(walking(headings=np.zeros(9))).segments == 3


@given(
    st.integers(1, 60),
    st.integers(-100, 200),
    st.floats(0.2, 40.0),
    st.integers(0, 24),
    st.integers(0, 24),
    st.integers(1, 20),
)
def test_ghosts_stay_inside_the_shot_and_are_as_many_as_asked_for(
    frames, now, per_step, before, after, every
):
    found = ghost_frames(walking(frames, now, per_step), Skins(before, after, every))
    assert len(found) <= before + after
    assert all(1 - 1e-6 <= frame <= frames + 1e-5 and 0 < alpha <= 1 for frame, alpha in found)
    assert len({frame for frame, _ in found}) == len(found)


def test_a_foresight_of_nothing_draws_nothing():
    empty = Foresight((), 1, 1, 2.0)
    for make in (path_lines, step_marks, action_labels, heading_arrows):
        assert make(empty).segments == 0
    assert ghost_lines(empty, Skins()).segments == 0


def test_of_labels_that_meet_the_more_important_one_is_read():
    low, high = Words(0, 0, 50, 10, rank=3), Words(20, 5, 50, 10, rank=0)
    aside = Words(200, 0, 50, 10, rank=3)
    assert readable([low, high, aside]) == [1, 2]
    assert readable([low, aside]) == [0, 1]


@given(st.lists(st.tuples(*[st.floats(0, 300)] * 4, st.integers(0, 3)), max_size=12))
def test_no_two_labels_that_are_read_meet_and_all_others_meet_one(numbers):
    labels = [Words(*each) for each in numbers]
    shown = readable(labels)
    assert not any(labels[a].meets(labels[b]) for a in shown for b in shown if a != b)
    for hidden in set(range(len(labels))) - set(shown):
        assert any(labels[hidden].meets(labels[each]) for each in shown)


def test_a_label_at_the_edge_of_a_region_is_moved_inside():
    moved = inside(Words(190, -20, 50, 10), 200, 100)
    assert moved.left + moved.width <= 200 and moved.bottom >= 0
