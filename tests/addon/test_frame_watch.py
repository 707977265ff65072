"""Progress, time left and Esc while a frame is awaited; no Blender needed."""

import pytest

from blender_addon.filming import frame_watch
from blender_addon.filming.frame_watch import FrameWatch, Place, place_in_range
from blender_addon.filming.pace import (
    REMEMBERED,
    SAVING_SECONDS,
    Pace,
    duration_in_words,
    seconds_left,
)
from blender_addon.filming.pace import share_done as share


class Bar:
    """Notes what Blender would show."""

    def __init__(self):
        self.shares, self.words, self.stopped = [], [], False

    def test_break(self):
        return self.stopped

    def update_progress(self, progress):
        self.shares.append(progress)

    def update_stats(self, _, info):
        self.words.append(info)


@pytest.fixture
def clock(monkeypatch):
    """The time in seconds, in a list to change it by."""
    now = [100.0]
    monkeypatch.setattr(frame_watch.time, "monotonic", lambda: now[0])
    return now


@pytest.mark.parametrize(
    ("durations", "frames", "into_this", "expected"),
    [
        ((), 10, 0.0, None),
        ((2.0,), 0, 0.0, None),
        ((2.0, 4.0), 1, 0.0, 3.0),
        ((2.0, 4.0), 10, 1.0, 29.0),
        ((2.0, 4.0), 10, 99.0, 27.0),
    ],
)
def test_the_rest_takes_as_long_as_the_frames_before(durations, frames, into_this, expected):
    assert seconds_left(durations, frames, into_this) == expected


def test_the_share_of_a_frame_grows_to_one_and_no_further():
    assert [share((4.0,), seconds) for seconds in (0.0, 1.0, 4.0, 9.0)] == [0.0, 0.25, 1.0, 1.0]
    assert share((), 3.0) == 0.0 and share((0.0,), 3.0) == 1.0


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.0, "1 s"), (59.2, "60 s"), (61.0, "2 min"), (3600.0, "1 h 00 min"), (5000, "1 h 24 min")],
)
def test_durations_are_said_as_people_say_them(seconds, words):
    assert duration_in_words(seconds) == words


def test_only_the_last_frames_of_a_kind_count_and_few_kinds_are_kept():
    pace = Pace()
    for number in range(REMEMBERED + 5):
        pace.note("a", 0.0, float(number))
    assert pace.of("a") == tuple(map(float, range(5, REMEMBERED + 5)))
    for number in range(100):
        pace.note(number, 0.0, 1.0)
    assert pace.of("a") == () and pace.of(99) == (1.0,)


def test_saving_counts_for_the_frame_that_follows_but_a_pause_does_not():
    pace = Pace()
    pace.note("a", 0.0, 2.0)
    pace.note("a", 5.0, 7.0, follows=True)
    pace.note("a", 8.0, 9.0)
    pace.note("a", 9.0 + SAVING_SECONDS, 11.0 + SAVING_SECONDS, follows=True)
    assert pace.of("a") == (2.0, 5.0, 1.0, 2.0)


def test_a_frame_knows_its_place_in_the_range_and_a_still_has_none():
    frames = range(10, 30, 2)
    assert place_in_range(("k",), 14, frames, True) == Place(("k",), 2, 10)
    assert place_in_range(("k",), 14, frames, False) == Place(("k",), 0, 1)
    assert place_in_range(("k",), 15, frames, True) == Place(("k",), 0, 1)


def test_progress_and_words_follow_the_clock(clock):
    bar, pace, doing = Bar(), Pace(), ["Starting the runtime"]
    pace.note("kind", 0.0, 10.0)
    watch = FrameWatch(bar, Place("kind", 1, 4), pace, lambda: doing[0])
    assert watch() is False
    clock[0] += 50.0
    watch()
    doing[0] = ""
    for _ in range(3):
        watch()
        clock[0] += 5.0
    assert bar.shares == [0.25, 0.25, 0.25, 0.375, 0.5]
    assert bar.words == [
        "Starting the runtime · frame 2 of 4 · about 30 s left",
        "Drawing · frame 2 of 4 · about 30 s left",
        "Drawing · frame 2 of 4 · about 25 s left",
        "Drawing · frame 2 of 4 · about 20 s left",
    ]
    watch.finish()
    assert bar.shares[-1] == 0.5
    # The frame for which the runtime had to start tells nothing of the others.
    assert pace.of("kind") == (10.0,)
    watch = FrameWatch(bar, Place("kind", 2, 4), pace, lambda: doing[0])
    clock[0] += 6.0
    watch.finish()
    assert pace.of("kind") == (10.0, 6.0)
    bar.stopped = True
    assert watch() is True


def test_without_memory_nothing_is_promised(clock):
    bar = Bar()
    FrameWatch(bar, Place("kind"), Pace(), lambda: "")()
    assert bar.words == ["Drawing"] and bar.shares == [0.0]
