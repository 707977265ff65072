import json

import numpy as np
import pytest
import torch
from small_world import (
    ACTIONS,
    box_of,
    camera,
    look_at,
    picture_of,
    small_config,
    small_environment,
    small_networks,
)

from pe_runtime import environment
from pe_runtime.checkpoint import load_checkpoint, save_checkpoint
from pe_runtime.config import as_dict
from pe_runtime.contract.errors import CheckpointError, ConfigError
from pe_runtime.environment import PlayableEnvironment, RenderOptions, find_model
from pe_runtime.state import hide, move, restyle, state_as_dict, state_from_dict
from pe_runtime.training.model_file import write_model
from pe_runtime.training.synthesis_phase import prefixed

VIEW = camera()
PLACES = {"player_1": (-0.7, 0.1, 0.0), "player_2": (0.8, -0.2, 0.0)}
EVERYTHING = RenderOptions(depth=True, masks=("ground", "backdrop", "sky", *PLACES))


def picture(view=VIEW, places=PLACES):
    return picture_of(places.values(), view, [0.9, 0.1][: len(places)])


def boxes(view=VIEW, places=PLACES):
    return {name: box_of(place, view) for name, place in places.items()}


@pytest.fixture(scope="module")
def loaded():
    return small_environment()


@pytest.fixture
def env(loaded):
    """The same model for all tests, with nothing kept of their frames."""
    loaded.forget()
    return loaded


@pytest.fixture(scope="module")
def state(loaded):
    return loaded.encode(picture(), VIEW, boxes())


@pytest.fixture(scope="module")
def model_file(loaded, tmp_path_factory):
    path = tmp_path_factory.mktemp("model") / "small.safetensors"
    facts = {"action_names": {"player": ACTIONS}}
    write_model(path, loaded.config, loaded.networks, loaded.actions, facts)
    return path


def rewritten(model_file, path, **header):
    facts, tensors = load_checkpoint(model_file)
    save_checkpoint(path, tensors, {k: v for k, v in (facts | header).items() if v is not None})
    return path


def test_a_model_file_gives_back_the_environment_it_was_written_from(env, state, model_file):
    loaded = PlayableEnvironment.load(model_file, device="cpu")
    assert loaded.config == env.config
    assert loaded.playable_names == ("player_1", "player_2")
    assert loaded.action_names == {"player_1": ACTIONS, "player_2": ACTIONS}
    assert loaded.steps_per_second == env.config.steps_per_second
    again = loaded.encode(picture(), VIEW, boxes())
    assert state_as_dict(again) == state_as_dict(state)
    assert loaded.render(state, VIEW).rgb.tobytes() == env.render(state, VIEW).rgb.tobytes()
    stepped, _ = loaded.step(state, {"player_1": 1}, VIEW)
    assert state_as_dict(stepped) == state_as_dict(env.step(state, {"player_1": 1}, VIEW)[0])


def test_a_synthesis_file_renders_and_says_that_it_has_no_actions_yet(env, state, tmp_path):
    path = tmp_path / "synthesis.safetensors"
    config = plain_config(env)
    save_checkpoint(path, prefixed(env.networks), {"kind": "synthesis", "config": config})
    loaded = PlayableEnvironment.load(str(path), device="cpu")
    assert loaded.action_names == {"player_1": (), "player_2": ()}
    assert loaded.render(state, VIEW).rgb.tobytes() == env.render(state, VIEW).rgb.tobytes()
    with pytest.raises(CheckpointError, match="no actions for 'player'.*pe train actions"):
        loaded.step(state, {"player_1": 0}, VIEW)
    with pytest.raises(CheckpointError, match="pe train actions"):
        loaded.infer_actions([state, state], [VIEW, VIEW])


def plain_config(env):
    return json.loads(json.dumps(as_dict(env.config)))


def test_an_unknown_model_names_the_built_in_ones(tmp_path, monkeypatch, model_file):
    monkeypatch.setattr(environment, "MODELS", tmp_path)
    (tmp_path / "tennis.safetensors").write_bytes(model_file.read_bytes())
    with pytest.raises(CheckpointError, match=r"'tenis'.*built in \(tennis\)"):
        PlayableEnvironment.load("tenis")
    assert find_model("tennis") == tmp_path / "tennis.safetensors"
    assert PlayableEnvironment.load("tennis", device="cpu").config.name == "small"


def test_a_path_wins_over_a_built_in_model_of_that_name(tmp_path, monkeypatch):
    (tmp_path / "duel").write_bytes(b"")
    monkeypatch.chdir(tmp_path)
    assert find_model("duel").read_bytes() == b""


@pytest.mark.parametrize("share", [0.0, 0.2, 0.9])
def test_a_truncated_model_is_one_clear_error(model_file, tmp_path, share):
    data = model_file.read_bytes()
    (tmp_path / "half.safetensors").write_bytes(data[: int(len(data) * share)])
    with pytest.raises(CheckpointError, match=r"half\.safetensors is damaged"):
        PlayableEnvironment.load(tmp_path / "half.safetensors")


def test_the_state_of_a_training_run_is_no_model(model_file, tmp_path):
    path = rewritten(model_file, tmp_path / "checkpoint.safetensors", kind="training")
    with pytest.raises(CheckpointError, match=r"state of a training run.*model\.safetensors"):
        PlayableEnvironment.load(path)


def test_a_model_without_a_configuration_is_one_clear_error(model_file, tmp_path):
    path = rewritten(model_file, tmp_path / "m.safetensors", config=None)
    with pytest.raises(ConfigError, match=r"configuration of .*m\.safetensors"):
        PlayableEnvironment.load(path)


def test_weights_that_do_not_fit_the_configuration_name_all_misfits(env, model_file, tmp_path):
    config = plain_config(env)
    config["classes"]["player"]["style_features"] = 9
    path = rewritten(model_file, tmp_path / "m.safetensors", config=config)
    with pytest.raises(CheckpointError, match=r"synthesis module.*misshapen.*style\.output"):
        PlayableEnvironment.load(path)


def test_encoding_finds_every_object(env, state):
    assert list(state.objects) == [each.name for each in env.config.objects]
    for name, place in PLACES.items():
        assert state[name].visible
        assert (state[name].position - torch.tensor(place)).norm() < 0.2


def test_an_object_without_a_box_is_hidden(env):
    only = env.encode(picture(), VIEW, {"player_2": boxes()["player_2"]})
    assert not only["player_1"].visible
    assert only["player_2"].visible


def test_no_box_at_all_is_an_empty_court(env):
    empty = env.encode(picture(), VIEW, {})
    frame = env.render(empty, VIEW, EVERYTHING)
    assert np.isfinite(frame.rgb).all()
    assert not frame.masks["player_1"].any() and not frame.masks["player_2"].any()


def test_an_environment_without_playable_objects_encodes_renders_and_steps():
    env = small_environment(small_config(players=0), actions=False)
    assert env.playable_names == () and env.action_names == {}
    state = env.encode(picture(places={}), VIEW, {})
    assert np.isfinite(env.render(state, VIEW).rgb).all()
    stepped, memory = env.step(state, {}, VIEW)
    assert state_as_dict(stepped) == state_as_dict(state)
    assert memory.objects == {}
    assert env.infer_actions([state, state], [VIEW, VIEW]) == {}


def test_a_larger_picture_of_the_same_view_gives_the_same_places(env, state):
    view = VIEW.scaled(96, 48)
    large = picture(VIEW).repeat(3, axis=0).repeat(3, axis=1)
    found = env.encode(large, view, boxes(view))
    for name in PLACES:
        assert (found[name].position - state[name].position).norm() < 1e-3


@pytest.mark.parametrize("turned", [np.s_[::1], np.s_[::-1]], ids=["read-only", "mirrored"])
def test_pictures_in_any_memory_are_encoded_without_a_warning(env, turned):
    # PyTorch would warn of a picture that it may not write to, once per process.
    seen = np.frombuffer(picture()[:, turned].tobytes(), np.float32).reshape(16, 32, 3)
    one = env.encode(seen[:, turned], VIEW, boxes())
    assert state_as_dict(one) == state_as_dict(env.encode(picture(), VIEW, boxes()))


def test_a_step_moves_only_the_objects_that_act(env, state):
    after, memory = env.step(state, {"player_1": 1}, VIEW)
    assert not torch.equal(after["player_1"].position, state["player_1"].position)
    assert not torch.equal(after["player_1"].pose, state["player_1"].pose)
    assert torch.equal(after["player_1"].style, state["player_1"].style)
    assert all(after[name] is state[name] for name in state.objects if name != "player_1")
    assert list(memory.objects) == ["player_1"]


def test_stepping_leaves_the_old_state_as_it_was(env, state):
    before = json.dumps(state_as_dict(state))
    env.step(state, {"player_1": 1, "player_2": 2}, VIEW)
    assert json.dumps(state_as_dict(state)) == before


def test_branching_from_one_state_and_memory_gives_what_each_branch_gives_alone(env, state):
    first, memory = env.step(state, {"player_1": 1}, VIEW)
    left = env.step(first, {"player_1": 1}, VIEW, memory)
    right = env.step(first, {"player_1": 2}, VIEW, memory)
    left_again = env.step(first, {"player_1": 1}, VIEW, memory)
    assert state_as_dict(left[0]) == state_as_dict(left_again[0])
    assert state_as_dict(left[0]) != state_as_dict(right[0])
    fresh_first, fresh_memory = env.step(state, {"player_1": 1}, VIEW)
    fresh = env.step(fresh_first, {"player_1": 1}, VIEW, fresh_memory)
    assert state_as_dict(fresh[0]) == state_as_dict(left[0])


def test_the_memory_matters(env, state):
    first, memory = env.step(state, {"player_1": 1}, VIEW)
    with_memory, _ = env.step(first, {"player_1": 1}, VIEW, memory)
    without, _ = env.step(first, {"player_1": 1}, VIEW)
    assert state_as_dict(with_memory) != state_as_dict(without)


def test_players_act_independently_of_each_other(env, state):
    both, _ = env.step(state, {"player_1": 1, "player_2": 2}, VIEW)
    alone, _ = env.step(state, {"player_2": 2}, VIEW)
    torch.testing.assert_close(both["player_2"].position, alone["player_2"].position)


def test_movement_is_relative_to_the_camera(env, state):
    front, behind = camera(0.0), camera(np.pi)
    moves = [
        env.step(state, {"player_1": 1}, view)[0]["player_1"].position - state["player_1"].position
        for view in (front, behind)
    ]
    torch.testing.assert_close(moves[0], -moves[1], atol=1e-5, rtol=0)


def test_a_hidden_player_stays_hidden_when_it_acts(env, state):
    after, _ = env.step(hide(state, "player_1"), {"player_1": 1}, VIEW)
    assert not after["player_1"].visible


@pytest.mark.parametrize("name", ["player_9", "ground"])
def test_only_playable_objects_act(env, state, name):
    with pytest.raises(ConfigError, match=f"'{name}' is not playable.*player_1"):
        env.step(state, {name: 0}, VIEW)


@pytest.mark.parametrize("action", [-1, len(ACTIONS)])
def test_an_action_out_of_range_names_the_range(env, state, action):
    with pytest.raises(ConfigError, match=f"action {action} .*0 to {len(ACTIONS) - 1}"):
        env.step(state, {"player_1": action}, VIEW)


def test_actions_are_inferred_between_states(env, state):
    states, memory = [state], None
    for _ in range(3):
        following, memory = env.step(states[-1], {"player_1": 1, "player_2": 0}, VIEW, memory)
        states.append(following)
    found = env.infer_actions(states, [VIEW] * 4)
    assert list(found) == ["player_1", "player_2"]
    for actions in found.values():
        assert actions.shape == (3,) and actions.dtype.kind == "i"
        assert ((actions >= 0) & (actions < len(ACTIONS))).all()
    assert env.infer_actions([state], [VIEW])["player_1"].shape == (0,)


def test_the_same_frame_twice_is_the_same_bytes(env, state):
    first = env.render(state, VIEW, EVERYTHING)
    env.render(move(state, "player_1", torch.tensor([1.0, 1.0, 0.0])), camera(0.7), EVERYTHING)
    second = env.render(state, VIEW, EVERYTHING)
    assert first.rgb.tobytes() == second.rgb.tobytes()
    assert first.depth.tobytes() == second.depth.tobytes()
    assert all(first.masks[n].tobytes() == second.masks[n].tobytes() for n in first.masks)


def test_a_state_that_went_through_json_renders_the_same_bytes(env, state):
    again = state_from_dict(json.loads(json.dumps(state_as_dict(state))))
    assert env.render(again, VIEW).rgb.tobytes() == env.render(state, VIEW).rgb.tobytes()


def test_a_frame_holds_what_was_asked_for_and_nothing_else(env, state):
    plain = env.render(state, VIEW)
    assert plain.rgb.shape == (16, 32, 3) and plain.rgb.dtype == np.float32
    assert (plain.rgb >= 0).all() and (plain.rgb <= 1).all()
    assert plain.depth is None and plain.masks == {}
    assert plain.statistics["rays"] == 16 * 32 // 4 + 16 * 32 // 16
    masked = env.render(state, VIEW, RenderOptions(masks=("player_1",)))
    assert masked.depth is None and list(masked.masks) == ["player_1"]
    assert masked.rgb.tobytes() == plain.rgb.tobytes()


def test_masks_sum_to_one_and_depth_is_metres_or_infinite(env, state):
    frame = env.render(state, VIEW, EVERYTHING)
    np.testing.assert_allclose(sum(frame.masks.values()), 1, atol=1e-5)
    assert all((m >= 0).all() and (m <= 1 + 1e-6).all() for m in frame.masks.values())
    assert not np.isnan(frame.depth).any()
    solid = np.isfinite(frame.depth)
    assert solid.any() and (frame.depth[solid] > 0).all() and (frame.depth[solid] < 20).all()
    assert (frame.masks["sky"][~solid] >= 0.5 - 1e-5).all()


def test_a_hidden_player_is_gone_from_the_picture_and_its_mask_is_empty(env, state):
    hidden = env.render(hide(state, "player_1"), VIEW, EVERYTHING)
    env.forget()
    shown = env.render(state, VIEW, EVERYTHING)
    assert not hidden.masks["player_1"].any()
    assert shown.masks["player_1"].any()
    assert hidden.statistics["field_samples"] < shown.statistics["field_samples"]
    assert not np.array_equal(hidden.rgb, shown.rgb)


def test_restyling_a_player_changes_no_mask(env, state):
    other = restyle(state, "player_1", state["player_2"].style)
    before, after = (env.render(each, VIEW, EVERYTHING) for each in (state, other))
    assert not np.array_equal(before.rgb, after.rgb)
    assert all(np.array_equal(before.masks[n], after.masks[n]) for n in before.masks)


@pytest.mark.parametrize("size", [(31, 15), (7, 5), (2, 3), (50, 17)])
def test_frames_of_odd_sizes_are_drawn_with_all_passes(env, state, size):
    width, height = size
    frame = env.render(state, VIEW.scaled(width, height), EVERYTHING)
    assert frame.rgb.shape == (height, width, 3)
    assert frame.depth.shape == (height, width)
    assert np.isfinite(frame.rgb).all()


@pytest.mark.parametrize("quality", ["balanced", "draft"])
def test_lower_qualities_are_near_the_exact_one(env, state, quality):
    exact = env.render(state, VIEW)
    frame = env.render(state, VIEW, RenderOptions(quality=quality, depth=True))
    assert np.abs(frame.rgb - exact.rgb).mean() < 0.05
    assert frame.rgb.dtype == np.float32 and frame.depth.dtype == np.float32
    assert frame.statistics["feature_samples"] <= exact.statistics["feature_samples"]


def test_an_unknown_quality_or_mask_names_the_known_ones(env, state):
    with pytest.raises(ConfigError, match="'best'.*exact, balanced, draft"):
        env.render(state, VIEW, RenderOptions(quality="best"))
    with pytest.raises(ConfigError, match="'player_7'.*player_1"):
        env.render(state, VIEW, RenderOptions(masks=("player_7",)))


def test_a_camera_under_the_court_or_within_a_player_still_gives_a_picture(env, state):
    inside = look_at((-0.7, 0.1, 0.9), (0.8, -0.2, 0.5))
    below = look_at((0.0, -3.0, -1.0), (0.0, 0.0, 0.5))
    for view in (inside, below):
        frame = env.render(state, view, EVERYTHING)
        assert np.isfinite(frame.rgb).all() and not np.isnan(frame.depth).any()


def test_networks_of_another_seed_draw_another_picture(env, state):
    networks = small_networks(env.config, seed=1)
    other = PlayableEnvironment(env.config, networks, env.actions, env.header)
    assert not np.array_equal(other.render(state, VIEW).rgb, env.render(state, VIEW).rgb)
