"""Objects alone and the background: laid over each other they are the picture again."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pe_runtime.contract.errors import ConfigError
from pe_runtime.environment import MODELS, PlayableEnvironment, RenderOptions
from pe_runtime.images import linear_from_srgb, srgb_from_linear
from pe_runtime.object_layers import cut_out
from pe_runtime.shots import start_state
from pe_runtime.shots.clips import start_from_clip
from pe_runtime.state import hide, move


@pytest.fixture(scope="module")
def duel():
    env = PlayableEnvironment.load("duel", "cpu")
    start = start_from_clip(MODELS / "duel_clip")
    return env, start_state(env, start), start.camera


def over(layer, behind):
    """A straight-alpha layer over a picture, in linear light."""
    alpha = layer[..., 3:]
    mixed = linear_from_srgb(behind) * (1 - alpha) + alpha * linear_from_srgb(layer[..., :3])
    return srgb_from_linear(mixed)


def test_a_lone_player_over_the_background_is_nearly_the_picture(duel):
    env, state, observer = duel
    alone = hide(state, "player_2")
    frame = env.render(alone, observer, RenderOptions(layers=("player_1",), background=True))
    away = np.abs(over(frame.layers["player_1"], frame.background) - frame.rgb)
    assert away.mean() < 0.5 / 255
    assert np.quantile(away, 0.99) < 4 / 255
    assert np.abs(frame.background - frame.rgb).max() > 0.3


def test_the_alpha_of_a_player_does_not_know_who_stands_in_front_of_it(duel):
    env, state, observer = duel
    place = state["player_1"].position.clone()
    place[1] -= 1.0
    covered = move(state, "player_2", place)
    asked = RenderOptions(masks=("player_1",), layers=("player_1", "player_2"))
    frame = env.render(covered, observer, asked)
    uncovered = env.render(hide(covered, "player_2"), observer, RenderOptions(masks=("player_1",)))
    np.testing.assert_array_equal(frame.layers["player_1"][..., 3], uncovered.masks["player_1"])
    assert frame.masks["player_1"].sum() < 0.7 * uncovered.masks["player_1"].sum()


def test_a_hidden_player_has_an_empty_layer_and_no_players_no_effect_on_the_background(duel):
    env, state, observer = duel
    asked = RenderOptions(layers=("player_1",), background=True)
    frame = env.render(hide(state, "player_1"), observer, asked)
    assert not frame.layers["player_1"][..., 3].any()
    there = env.render(state, observer, RenderOptions(background=True))
    np.testing.assert_array_equal(frame.background, there.background)


def test_layers_and_background_of_a_region_are_those_of_the_whole(duel):
    env, state, observer = duel
    asked = RenderOptions(layers=("player_1",), background=True)
    whole = env.render(state, observer, asked)
    part = env.render(
        state,
        observer,
        RenderOptions(layers=("player_1",), background=True, region=(40, 30, 50, 60)),
    )
    cut = slice(30, 90), slice(40, 90)
    np.testing.assert_array_equal(part.layers["player_1"], whole.layers["player_1"][cut])
    np.testing.assert_array_equal(part.background, whole.background[cut])


def test_nobody_pays_for_layers_that_are_not_asked_for(duel, monkeypatch):
    env, state, observer = duel
    env.forget()
    drawn, draw = [], env.renderer.draw
    monkeypatch.setattr(env.renderer, "draw", lambda *given: drawn.append(1) or draw(*given))
    frame = env.render(state, observer, RenderOptions())
    assert len(drawn) == 1 and not frame.layers and frame.background is None


@pytest.mark.parametrize("name", ["ground", "player_3"])
def test_only_playable_objects_have_layers(duel, name):
    env, state, observer = duel
    with pytest.raises(ConfigError, match=f"no layer of {name!r}.*player_1, player_2"):
        env.render(state, observer, RenderOptions(layers=(name,)))


UNIT = st.floats(0, 1, width=32)


@given(UNIT, UNIT, st.floats(0.0625, 1, width=32))
def test_a_true_mixture_is_taken_apart_into_what_it_was(colour, behind, alpha):
    layer = np.full((1, 1, 4), colour, np.float32)
    layer[..., 3] = alpha
    background = np.full((1, 1, 3), behind, np.float32)
    picture = over(layer, background).astype(np.float32)
    found = cut_out(picture, background, layer[..., 3])
    np.testing.assert_allclose(over(found, background), picture, atol=2e-3)
    assert found.min() >= 0 and found.max() <= 1
