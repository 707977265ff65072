"""Headings in a real, tiny environment: predicted, sent over the wire, overridden, drawn."""

import dataclasses

import numpy as np
import pytest
import tiny_model
import torch

from pe_runtime.action.module import ActionModule
from pe_runtime.checkpoint import save_checkpoint
from pe_runtime.config import as_dict
from pe_runtime.contract.errors import CheckpointError
from pe_runtime.contract.messages import HEADING_PREFIX
from pe_runtime.contract.shot import ObjectTrack, Shot
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.networks import SynthesisNetworks
from pe_runtime.shots import frame_state, prepare_shot, render_shot, rollout_key
from pe_runtime.shots.clips import start_from_clip
from pe_runtime.shots.frames import frame_digest
from pe_runtime.worker.model_world import ModelWorld


def write_turning_model(path, acting=True):
    """The tiny model, but its players turn; without an action module they only stand."""
    torch.manual_seed(0)
    config = tiny_model.tiny_config()
    turning = dataclasses.replace(config.action, sees_heading=True, predict_heading=True)
    config = dataclasses.replace(config, action=turning)
    networks = SynthesisNetworks(config)
    tensors = {f"synthesis.{name}": each for name, each in networks.state_dict().items()}
    if acting:
        module = ActionModule(config.action, 4, 3)
        tensors |= {f"actions.player.{name}": each for name, each in module.state_dict().items()}
    save_checkpoint(path, tensors, {"kind": "synthesis", "config": as_dict(config)})
    return str(path)


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return write_turning_model(tmp_path_factory.mktemp("model") / "turning.safetensors")


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    return tiny_model.write_clip(tmp_path_factory.mktemp("clip"))


@pytest.fixture
def shot(model, clip):
    return Shot(
        version=1,
        model=model,
        start=start_from_clip(clip),
        fps=10.0,
        frame_start=1,
        frame_end=7,
        cameras=(tiny_model.camera(),) * 7,
        objects=(ObjectTrack("player_1", ((1, 1),)),),
    )


def turned(shot, headings):
    track = dataclasses.replace(shot.objects[0], headings=headings)
    return dataclasses.replace(shot, objects=(track,))


def test_a_rollout_sends_the_heading_of_every_frame(model, shot):
    world = ModelWorld("cpu")
    assert world.load(model).turning_names == tuple(tiny_model.PLACES)
    buffers = world.rollout(shot)
    predicted = prepare_shot(PlayableEnvironment.load(model, "cpu"), shot).rollout
    for name in tiny_model.PLACES:
        headings = buffers[f"{HEADING_PREFIX}{name}"]
        assert headings.dtype == np.float64
        assert headings.tolist() == [state[name].heading for state in predicted.states]
    assert np.abs(np.diff(buffers[f"{HEADING_PREFIX}player_1"])).min() > 0.0
    assert not buffers[f"{HEADING_PREFIX}player_2"].any()


def test_a_model_that_does_not_turn_sends_no_headings(clip, shot, tmp_path):
    model = tiny_model.write_model(tmp_path / "plain.safetensors")
    world = ModelWorld("cpu")
    world.load(model)
    buffers = world.rollout(dataclasses.replace(shot, model=model))
    assert set(buffers) == set(tiny_model.PLACES)


def test_headings_of_a_shot_replace_the_predicted_ones(model, shot):
    environment = PlayableEnvironment.load(model, "cpu")
    headings = tuple(0.1 * frame for frame in range(7))
    prepared = prepare_shot(environment, turned(shot, headings))
    assert [frame_state(prepared, f)["player_1"].heading for f in shot.frames] == list(headings)
    assert frame_state(prepared, 7)["player_2"].heading == 0.0
    free = prepare_shot(environment, shot)
    assert frame_state(free, 7)["player_1"].heading == free.rollout.at(7)["player_1"].heading


def test_a_turned_player_is_another_picture_with_another_digest(model, shot, tmp_path):
    environment = PlayableEnvironment.load(model, "cpu")
    one, other = turned(shot, (0.0,) * 7), turned(shot, (0.0,) * 6 + (1.0,))
    digests = [
        [frame_digest("m", prepare_shot(environment, each), frame) for frame in (6, 7)]
        for each in (one, other)
    ]
    assert digests[0][0] == digests[1][0] and digests[0][1] != digests[1][1]
    render_shot(environment, one, tmp_path, frames=[6, 7])
    assert render_shot(environment, other, tmp_path, frames=[6, 7]).written == (7,)
    pictures = [
        environment.render(frame_state(prepare_shot(environment, each), 7), tiny_model.camera()).rgb
        for each in (one, other)
    ]
    assert not np.array_equal(*pictures)


def test_shots_that_differ_in_headings_only_share_their_rollout(shot):
    assert rollout_key(turned(shot, (1.0,) * 7)) == rollout_key(shot)


def test_a_model_without_actions_rolls_out_and_draws_what_stands_still(clip, shot, tmp_path):
    model = write_turning_model(tmp_path / "still.safetensors", acting=False)
    world = ModelWorld("cpu")
    facts = world.load(model)
    assert facts.action_names == {"player_1": (), "player_2": ()} and not facts.turning_names
    resting = dataclasses.replace(shot, model=model, objects=(ObjectTrack("player_1"),))
    assert np.ptp(world.rollout(resting)["player_1"], axis=0).max() == 0.0
    assert next(world.render(resting, [7])).buffers["rgb"].shape == (16, 32, 3)
    with pytest.raises(CheckpointError, match="no actions for 'player'"):
        world.rollout(dataclasses.replace(shot, model=model))
