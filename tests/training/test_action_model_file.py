import dataclasses

import pytest
import torch
from small_world import small_clips, small_config, small_networks

from pe_runtime.checkpoint import load_checkpoint
from pe_runtime.contract.envelope import ENVELOPE_KEY
from pe_runtime.curation.envelope import known_envelope
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.training.action_config import ActionTrainingConfig
from pe_runtime.training.encoded_clips import encode_clips
from pe_runtime.training.model_file import train_model_actions, write_model

ONE_STEP = ActionTrainingConfig(steps=1, batch=4, longest_move=9.0, learning_rate=0.0)


@pytest.fixture(scope="module")
def synthesis(tmp_path_factory):
    path = tmp_path_factory.mktemp("synthesis") / "synthesis.safetensors"
    write_model(path, small_config(), small_networks(), {}, {})
    return path


@pytest.fixture(scope="module")
def trained(synthesis, tmp_path_factory):
    return train_model_actions(synthesis, small_clips(), ONE_STEP, tmp_path_factory.mktemp("run"))


def weights(path, kind):
    tensors = load_checkpoint(path)[1]
    return {n: t for n, t in tensors.items() if n.startswith(kind) and not n.endswith(("_u", "_v"))}


def same(first, second):
    return first.keys() == second.keys() and all(torch.equal(first[n], second[n]) for n in first)


def test_a_trained_model_keeps_its_judge_and_still_loads(trained):
    assert weights(trained, "judges.player.layers.0")
    loaded = PlayableEnvironment.load(trained, device="cpu")
    assert len(loaded.action_names["player_1"]) == loaded.config.action.actions


def test_a_trained_model_has_no_action_that_nobody_takes(trained):
    loaded = PlayableEnvironment.load(trained, device="cpu")
    assert "unused" not in loaded.action_names["player_1"]
    assert 1 <= loaded.config.action.actions <= small_config().action.actions


def test_a_model_says_what_it_was_trained_on_and_keeps_what_its_drawing_says(trained, tmp_path):
    own = load_checkpoint(trained)[0][ENVELOPE_KEY]
    assert own == known_envelope(small_clips())[ENVELOPE_KEY]
    others = dataclasses.replace(small_clips(), boxes=small_clips().boxes + 5.0)
    again = train_model_actions(trained, others, ONE_STEP, tmp_path)
    assert load_checkpoint(again)[0][ENVELOPE_KEY] == own != known_envelope(others)[ENVELOPE_KEY]


@pytest.mark.parametrize("go_on", [True, False])
def test_a_training_goes_on_from_the_models_own_actions_only_when_told(trained, tmp_path, go_on):
    # A rate of zero leaves the weights as they were at the start.
    training = dataclasses.replace(ONE_STEP, seed=5, go_on=go_on, discriminator_learning_rate=0.0)
    again = train_model_actions(trained, small_clips(), training, tmp_path)
    for kind in ("actions.", "judges."):
        assert same(weights(trained, kind), weights(again, kind)) is go_on


def test_going_on_from_a_synthesis_module_starts_anew(synthesis, tmp_path):
    training = dataclasses.replace(ONE_STEP, go_on=True)
    assert weights(train_model_actions(synthesis, small_clips(), training, tmp_path), "actions.")


def test_headings_of_the_encoder_reach_the_data(monkeypatch):
    networks, clips = small_networks(), small_clips()
    assert encode_clips(networks, clips, "player").headings is None
    plain = networks.encode

    def turned(*arguments):
        codes = plain(*arguments)
        times = torch.arange(4.0)
        return {n: dataclasses.replace(each, heading=times) for n, each in codes.items()}

    monkeypatch.setattr(networks, "encode", turned)
    headings = encode_clips(networks, clips, "player").headings
    assert torch.equal(headings, torch.arange(4.0).expand(4, 4))


def test_a_model_says_which_frame_its_dynamics_were_trained_in(synthesis, tmp_path):
    training = dataclasses.replace(ONE_STEP, dynamics_frame="world")
    path = train_model_actions(synthesis, small_clips(), training, tmp_path)
    assert PlayableEnvironment.load(path, device="cpu").config.action.movement_frame == "world"
