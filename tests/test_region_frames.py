"""A region of a frame is the same part of the whole frame, drawn with fewer rays."""

from dataclasses import replace

import numpy as np
import pytest
from small_world import camera, random_codes, small_environment
from test_frame_renderer import codes_of, released_networks, view

from pe_runtime.contract.errors import ConfigError
from pe_runtime.environment import MODELS, PlayableEnvironment, RenderOptions
from pe_runtime.frame_renderer import FrameRenderer
from pe_runtime.rendering.regions import Region
from pe_runtime.rendering.scene import RenderSettings
from pe_runtime.shots import start_state
from pe_runtime.shots.clips import start_from_clip
from pe_runtime.state import EnvironmentState, ObjectState, move

LARGE = camera(width=97, rows=61)
PASSES = RenderOptions(depth=True, masks=("player_1", "ground"))
REGIONS = [(0, 0, 97, 61), (96, 60, 1, 1), (0, 0, 1, 1), (31, 20, 12, 9), (5, 33, 90, 7)]


def small_state(env, seed=0):
    return EnvironmentState(
        {
            name: ObjectState(each.position[0], each.style[0], each.pose[0])
            for name, each in random_codes(env.config, seed=seed).items()
        }
    )


@pytest.fixture(scope="module")
def small():
    env = small_environment()
    return env, small_state(env), LARGE


@pytest.fixture(scope="module")
def duel():
    env = PlayableEnvironment.load("duel", "cpu")
    start = start_from_clip(MODELS / "duel_clip")
    return env, start_state(env, start), start.camera


def part_of(frame, region):
    left, top, width, height = region
    rows, columns = slice(top, top + height), slice(left, left + width)
    masks = {name: each[rows, columns] for name, each in frame.masks.items()}
    return frame.rgb[rows, columns], frame.depth[rows, columns], masks


def furthest(frame, whole, region):
    """Greatest differences of colour, of depth where both are finite, and of masks."""
    rgb, depth, masks = part_of(whole, region)
    assert frame.rgb.shape == rgb.shape and frame.depth.shape == depth.shape
    assert np.array_equal(np.isinf(frame.depth), np.isinf(depth))
    solid = np.isfinite(depth)
    away = [np.abs(frame.masks[name] - mask).max() for name, mask in masks.items()]
    metres = np.abs(frame.depth[solid] - depth[solid]).max(initial=0.0)
    return np.abs(frame.rgb - rgb).max(), metres, max(away)


@pytest.mark.parametrize("region", REGIONS, ids=str)
def test_a_region_is_that_part_of_the_whole_frame_to_the_last_bit(small, region):
    env, state, observer = small
    env.forget()
    whole = env.render(state, observer, PASSES)
    env.forget()
    drawn = env.render(state, observer, replace(PASSES, region=region))
    assert furthest(drawn, whole, region) == (0.0, 0.0, 0.0)


BOUNDS = {"exact": 0.0, "balanced": 2 / 255, "draft": 4 / 255}


@pytest.mark.parametrize("quality", BOUNDS)
def test_a_region_of_the_built_in_model_is_that_of_the_whole(duel, quality):
    env, state, observer = duel
    asked = RenderOptions(quality, depth=True, masks=("player_1", "player_2"))
    whole = env.render(state, observer, asked)
    for region in ((40, 30, 60, 70), (201, 100, 55, 44), (0, 0, 3, 144)):
        drawn = env.render(state, observer, replace(asked, region=region))
        colour, metres, share = furthest(drawn, whole, region)
        assert max(colour, share) <= BOUNDS[quality], region
        assert metres <= 10 * BOUNDS[quality], region


def test_a_small_region_draws_far_fewer_rays(duel):
    env, state, observer = duel
    env.forget()
    whole = env.render(state, observer, RenderOptions("draft")).statistics["rays"]
    corner = env.render(state, observer, RenderOptions("draft", region=(0, 0, 16, 16)))
    assert 0 < corner.statistics["rays"] < 0.15 * whole
    large = observer.scaled(4 * observer.width, 4 * observer.height)
    middle = env.render(state, large, RenderOptions("draft", region=(500, 300, 16, 16)))
    assert 0 < middle.statistics["rays"] < 0.02 * 16 * whole


def test_a_frame_after_a_region_and_a_region_after_a_frame_are_as_if_drawn_alone(small):
    env, state, observer = small
    moved = move(state, "player_1", state["player_1"].position + 0.2)
    one, other = (20, 20, 30, 30), (25, 22, 30, 30)
    order = [
        (state, one),
        (moved, one),
        (moved, other),
        (moved, None),
        (state, other),
        (state, None),
    ]
    env.forget()
    inarow = [env.render(s, observer, RenderOptions(region=region)).rgb for s, region in order]
    for (each, region), drawn in zip(order, inarow, strict=True):
        env.forget()
        alone = env.render(each, observer, RenderOptions(region=region)).rgb
        np.testing.assert_array_equal(drawn, alone)


def test_a_region_under_a_standing_camera_keeps_what_stands_still(small):
    env, state, observer = small
    env.forget()
    asked = RenderOptions(region=(10, 10, 60, 40))
    env.render(state, observer, asked)
    moved = move(state, "player_1", state["player_1"].position + 0.2)
    assert env.render(moved, observer, asked).statistics["kept_objects"] > 0


@pytest.mark.parametrize("quadrature", ["interval", "release-2022"])
def test_a_region_is_exact_under_either_quadrature(small, quadrature):
    networks = small[0].networks if quadrature == "interval" else released_networks()
    codes, region = codes_of(networks), Region(7, 9, 20, 31)
    whole, _ = FrameRenderer(networks).draw(view(), codes, RenderSettings())
    drawn, _ = FrameRenderer(networks).draw(view(), codes, RenderSettings(), region)
    np.testing.assert_array_equal(drawn, whole[:, 7:20, 9:31])


@pytest.mark.parametrize("region", [(0, 0, 0, 4), (0, 0, 4, 0), (-1, 0, 4, 4), (90, 0, 8, 4)])
def test_an_empty_region_or_one_outside_of_the_camera_is_refused(small, region):
    env, state, observer = small
    with pytest.raises(ConfigError, match="region.*97x61"):
        env.render(state, observer, RenderOptions(region=region))
