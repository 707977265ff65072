"""Frames whose every input is as before are given again, within a bound of memory."""

import numpy as np
import pytest
import torch
from small_world import camera, small_environment

from pe_runtime.environment import RenderOptions
from pe_runtime.kept_frames import Frame, KeptFrames
from pe_runtime.state import change, hide, move, repose, restyle, turn

VIEW = camera()
PLACES = {"player_1": (-0.7, 0.1, 0.0), "player_2": (0.8, -0.2, 0.0)}
OPTIONS = RenderOptions(depth=True, masks=("player_1",))


@pytest.fixture
def env():
    return small_environment()


@pytest.fixture
def state(env):
    picture = np.full((VIEW.height, VIEW.width, 3), 0.5, np.float32)
    found = env.encode(picture, VIEW, {})
    for name, place in PLACES.items():
        found = change(found, name, position=torch.tensor(place), visible=True)
    return found


def test_the_same_frame_again_costs_nothing_and_is_the_same(env, state):
    first, again = (env.render(state, VIEW, OPTIONS) for _ in range(2))
    assert first.statistics["kept_frames"] == 0
    assert first.statistics["rays"] > 0
    assert again.statistics["kept_frames"] == 1
    assert sum(again.statistics.values()) == 1
    assert np.array_equal(first.rgb, again.rgb)
    assert np.array_equal(first.depth, again.depth)
    assert np.array_equal(first.masks["player_1"], again.masks["player_1"])


def test_every_input_counts(env, state):
    env.render(state, VIEW, OPTIONS)
    own = state["player_1"]
    others = [
        (move(state, "player_1", own.position + 0.01), VIEW, OPTIONS),
        (restyle(state, "player_1", own.style + 0.1), VIEW, OPTIONS),
        (repose(state, "player_1", own.pose + 0.1), VIEW, OPTIONS),
        (turn(state, "player_1", 0.2), VIEW, OPTIONS),
        (hide(state, "player_1"), VIEW, OPTIONS),
        (state, camera(0.21), OPTIONS),
        (state, camera(width=30), OPTIONS),
        (state, VIEW, RenderOptions("draft", True, ("player_1",))),
        (state, VIEW, RenderOptions(depth=True, masks=("player_2",))),
        (state, VIEW, RenderOptions(depth=False, masks=("player_1",))),
    ]
    for each in others:
        assert env.render(*each).statistics["kept_frames"] == 0
    assert env.render(state, VIEW, OPTIONS).statistics["kept_frames"] == 1


def test_nobody_can_change_what_is_kept(env, state):
    first = env.render(state, VIEW, OPTIONS)
    wanted = first.rgb.copy()
    first.rgb[:] = 7.0
    env.render(state, VIEW, OPTIONS).rgb[:] = 8.0
    assert np.array_equal(env.render(state, VIEW, OPTIONS).rgb, wanted)


def test_what_is_kept_can_be_given_back(env, state):
    env.render(state, VIEW, OPTIONS)
    env.forget()
    again = env.render(state, VIEW, OPTIONS)
    assert again.statistics["kept_frames"] == again.statistics["kept_objects"] == 0


def test_the_oldest_frames_give_way():
    kept = KeptFrames(limit=3 * 48)
    for key in range(4):
        kept.keep(key, Frame(np.full((2, 2, 3), key, np.float32)))
        kept.get(0)
    assert kept.get(0) is not None
    assert kept.get(1) is None
    assert kept.get(2) is not None and kept.get(3) is not None
    kept.clear()
    assert kept.get(0) is None


def test_the_last_frame_is_kept_however_large_and_then_alone():
    kept = KeptFrames(limit=3 * 48)
    kept.keep("small", Frame(np.zeros((2, 2, 3), np.float32)))
    kept.keep("large", Frame(np.ones((9, 9, 3), np.float32)))
    assert np.array_equal(kept.get("large").rgb, np.ones((9, 9, 3)))
    assert kept.get("small") is None
    kept.keep("small", Frame(np.zeros((2, 2, 3), np.float32)))
    assert kept.get("large") is None


def test_a_frame_without_pixels_is_kept_too():
    kept = KeptFrames()
    kept.keep("nothing", Frame(np.zeros((0, 3, 3), np.float32)))
    assert kept.get("nothing").rgb.shape == (0, 3, 3)
