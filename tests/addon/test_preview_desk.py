"""The newest view wins: what is drawn next, what is dropped, what is shown; no Blender needed."""

import dataclasses

import numpy as np
import pytest
from addon.stage import front_camera, shot_of

from blender_addon.preview.desk import PATIENCE_SECONDS, STILL_SECONDS, Desk, Wish
from blender_addon.preview.resolution import (
    BAND_ROWS,
    BAND_SECONDS,
    QUICK_SECONDS,
    SCALES,
    Cost,
    next_band,
    quick_size,
)

SIZE = (640, 360)


@pytest.fixture
def clock():
    return [0.0]


@pytest.fixture
def desk(clock):
    return Desk(lambda: clock[0])


@pytest.fixture
def whole(picture):
    return shot_of(picture, frames=1, passes=())


def wish_of(whole, step=0, size=SIZE):
    """The view of a camera that has gone some steps."""
    camera = front_camera(*size)
    pose = camera.world_from_camera.copy()
    pose[0, 3] += step
    take = dataclasses.replace(
        whole, cameras=(dataclasses.replace(camera, world_from_camera=pose),)
    )
    return Wish(take, whole)


def picture(job, value):
    height, width = (job.size[1], job.size[0]) if job.band is None else job.band[:1:-1]
    return np.full((height, width, 3), value, np.uint8)


def test_a_view_is_drawn_quickly_and_when_it_rests_in_full(desk, clock, whole):
    desk.want(wish_of(whole))
    quick = desk.take_job()
    assert quick.band is None and quick.size == quick_size(SIZE, None) == (160, 90)
    assert quick.shot.size == quick.size
    assert desk.take_job() is None and desk.has_more
    desk.deliver(quick, picture(quick, 1), 0.01)
    assert desk.take_job() is None and desk.has_more
    clock[0] += STILL_SECONDS
    rows = 0
    while (job := desk.take_job()) is not None:
        assert job.size == SIZE and job.band[:3] == (0, rows, SIZE[0])
        assert job.shot.size == job.band[2:] and job.shot.region == job.band
        desk.deliver(job, picture(job, 2), 0.4)
        rows += job.band[3]
        assert (desk.shown.rgb[:rows] == 2).all() and (desk.shown.rgb[rows:] == 1).all()
    assert rows == SIZE[1] and not desk.has_more
    assert desk.shown.rgb.shape == (*SIZE[::-1], 3)


def test_the_same_view_again_changes_nothing(desk, clock, whole):
    desk.want(wish_of(whole))
    desk.deliver(job := desk.take_job(), picture(job, 1), 0.01)
    clock[0] += STILL_SECONDS / 2
    desk.want(wish_of(whole))
    clock[0] += STILL_SECONDS / 2
    assert desk.take_job().band is not None


def test_the_newest_view_wins_and_older_answers_never_replace_newer_ones(desk, whole):
    desk.want(wish_of(whole, 0))
    first = desk.take_job()
    for step in (1, 2, 3):
        desk.want(wish_of(whole, step))
    desk.deliver(first, picture(first, 1), 0.01)
    assert desk.shown.rgb[0, 0, 0] == 1  # better than nothing
    last = desk.take_job()
    assert last.wish == wish_of(whole, 3)
    desk.deliver(last, picture(last, 3), 0.01)
    desk.deliver(first, picture(first, 1), 0.01)
    assert desk.shown.rgb[0, 0, 0] == 3


def test_a_part_of_the_full_picture_is_dropped_as_soon_as_the_view_moves(desk, clock, whole):
    desk.want(wish_of(whole, 0))
    desk.deliver(job := desk.take_job(), picture(job, 1), 0.01)
    clock[0] += STILL_SECONDS
    band = desk.take_job()
    assert band.band is not None and not desk.is_outdated(band)
    desk.want(wish_of(whole, 1))
    assert desk.is_outdated(band)
    desk.give_up(band)
    quick = desk.take_job()
    assert quick.wish == wish_of(whole, 1) and quick.band is None


def test_a_quick_picture_may_be_finished_unless_it_is_slow(desk, clock, whole):
    desk.want(wish_of(whole, 0))
    job = desk.take_job()
    desk.want(wish_of(whole, 1))
    assert not desk.is_outdated(job)
    clock[0] += PATIENCE_SECONDS * 1.01
    assert desk.is_outdated(job)


def test_what_cannot_be_drawn_is_not_tried_again_until_the_scene_changes(desk, whole):
    desk.want(wish_of(whole, 0))
    desk.give_up(desk.take_job(), "no such model")
    desk.want(wish_of(whole, 1))
    assert desk.failure == "no such model" and desk.take_job() is None and not desk.has_more
    other = dataclasses.replace(whole, model="another")
    desk.want(wish_of(other))
    assert desk.failure == "" and desk.take_job() is not None


def test_made_way_it_is_tried_again(desk, whole):
    desk.want(wish_of(whole))
    desk.give_up(desk.take_job())
    assert desk.has_more and desk.take_job() is not None


def test_a_closed_desk_and_one_without_a_wish_have_nothing_to_do(desk, whole):
    assert desk.take_job() is None and not desk.has_more
    desk.want(wish_of(whole))
    job = desk.take_job()
    desk.close()
    assert desk.is_outdated(job) and desk.take_job() is None and not desk.has_more


@pytest.mark.parametrize("full", [(1920, 1080), (333, 77), (30, 500), (1, 1)])
@pytest.mark.parametrize("cost", [1e-9, 1e-7, 3e-6, 1e-3])
def test_quick_pictures_keep_to_their_time_or_are_as_small_as_they_get(full, cost):
    size = quick_size(full, cost)
    assert all(0 < mine <= whole for mine, whole in zip(size, full, strict=True))
    seconds = cost * full[0] * full[1]
    smallest = seconds * SCALES[-1] ** 2 > QUICK_SECONDS
    if min(full) > 200 and not smallest:
        # Whole pixels: a size may be a row and a column larger than its share.
        assert cost * (size[0] - 1) * (size[1] - 1) <= QUICK_SECONDS
    if seconds <= QUICK_SECONDS:
        assert size == full


@pytest.mark.parametrize("cost", [None, 1e-8, 1e-6, 1e-3])
def test_bands_cover_the_picture_once_and_keep_to_their_time(cost):
    full, done = (800, 333), 0
    while done < full[1]:
        left, top, width, rows = next_band(full, done, cost)
        assert (left, top, width) == (0, done, full[0]) and rows > 0
        if cost and rows > BAND_ROWS:
            assert cost * width * rows <= BAND_SECONDS
        done += rows
    assert done == full[1]


def test_the_cost_follows_what_pictures_take_lately():
    cost = Cost()
    cost.note((10, 10), 1.0)
    assert cost.seconds_per_pixel == 0.01
    cost.note((10, 10), 3.0)
    assert cost.seconds_per_pixel == 0.02
