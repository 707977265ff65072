"""Long play on the toy world: a model that keeps its ways, and ones that do not."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from toy_world import ToyEnvironment, record

from pe_runtime.contract.episode import read_dataset, read_episode
from pe_runtime.contract.errors import ConfigError, EpisodeError
from pe_runtime.evaluation import confidence, long_play, pose_movement
from pe_runtime.evaluation.long_play import (
    LONG_PLAY_FIGURES,
    random_script,
    walking_actions,
)
from pe_runtime.evaluation.long_play import (
    long_play as play,
)
from pe_runtime.evaluation.pose_movement import distance_from_mean, liveliness
from pe_runtime.evaluation.rules import LONG_PLAY
from pe_runtime.kept_frames import Frame
from pe_runtime.state import EnvironmentState

SHORT = 60


class Tiring(ToyEnvironment):
    """Walks ever more slowly: by a twentieth less with each step."""

    def step(self, state, actions, camera, memory=None):
        after, count = super().step(state, actions, camera, memory)
        share = 0.95**count
        return blended(state, after, share), count


class Sinking(ToyEnvironment):
    """Loses a millimetre of height a step."""

    def step(self, state, actions, camera, memory=None):
        after, count = super().step(state, actions, camera, memory)
        down = torch.tensor([0.0, 0.0, -0.001])
        objects = {n: replace(o, position=o.position + down) for n, o in after.objects.items()}
        return EnvironmentState(objects), count


class Bursting(ToyEnvironment):
    """Is no number any more after forty steps."""

    def step(self, state, actions, camera, memory=None):
        after, count = super().step(state, actions, camera, memory)
        if count < 40:
            return after, count
        objects = {n: replace(o, pose=o.pose * torch.nan) for n, o in after.objects.items()}
        return EnvironmentState(objects), count


def blended(before, after, share):
    objects = {
        name: replace(each, position=torch.lerp(before[name].position, each.position, share))
        for name, each in after.objects.items()
    }
    return EnvironmentState(objects)


@pytest.fixture(scope="module", autouse=True)
def quick():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(confidence, "RESAMPLES", 10)
        # Short scripts, and walks that are held for two steps: the toy's players are fickle.
        short = replace(LONG_PLAY, starts=2, steps=SHORT, late=30, window=2)
        patch.setattr(long_play, "LONG_PLAY", short)
        patch.setattr(pose_movement, "LONG_PLAY", short)
        # What stands 60 m away or behind the camera cannot be painted as a card.
        patch.setattr(ToyEnvironment, "render", empty_picture)
        yield


def empty_picture(self, state, camera, options=None):
    return Frame(np.zeros((camera.height, camera.width, 3), np.float32))


@pytest.fixture(scope="module")
def episodes(tmp_path_factory):
    root = record(tmp_path_factory.mktemp("toy"), sequences=3)
    return [read_episode(folder) for folder in read_dataset(root)[1]]


def values(environment, episodes):
    return {name: figure.value for name, figure in play(environment, episodes).items()}


def test_a_model_that_walks_on_and_on_is_steady(episodes):
    figures = values(ToyEnvironment(), episodes)
    assert list(figures) == list(LONG_PLAY_FIGURES)
    assert figures["finite"] == 100
    assert figures["steady_speed"] == 100
    assert figures["speed_change"] == pytest.approx(0, abs=1e-4)
    assert figures["farthest_per_step"] == pytest.approx(0.3, abs=1e-3)
    assert figures["height_error"] == pytest.approx(0, abs=1e-5)


def test_poses_that_stand_still_while_walking_are_not_lively(episodes):
    # The toy's dynamics never change a pose; recorded ones are a new grey in every frame.
    assert values(ToyEnvironment(), episodes)["liveliness"] == pytest.approx(0, abs=1e-6)


def test_a_model_that_tires_is_not_steady(episodes):
    figures = values(Tiring(), episodes)
    # Three of four actions walk; they are the ones that have become slower.
    assert figures["steady_speed"] == pytest.approx(25)
    assert figures["speed_change"] > 0.1


def test_a_model_that_sinks_is_seen_to(episodes):
    assert values(Sinking(), episodes)["height_error"] == pytest.approx(0.001 * SHORT, abs=1e-4)


def test_states_that_burst_are_not_finite(episodes):
    assert play(Bursting(), episodes)["finite"].value == 0


def test_a_model_without_actions_and_data_without_players_are_refused(episodes, tmp_path):
    with pytest.raises(ConfigError, match="trained actions"):
        play(ToyEnvironment(actions={}), episodes)
    root = record(tmp_path, sequences=1, absent=[(0, 2, "left")])
    with pytest.raises(EpisodeError, match="all players"):
        play(ToyEnvironment(), [read_episode(root / "00000")])


def test_walking_actions_are_those_that_move(episodes):
    assert walking_actions(ToyEnvironment(), episodes[0]) == [1, 2, 3]


def test_random_scripts_hold_their_actions_and_repeat_with_their_seed():
    script = random_script(np.random.default_rng(0), 5)
    assert script.tolist() == random_script(np.random.default_rng(0), 5).tolist()
    assert len(script) == SHORT
    assert set(script.tolist()) <= set(range(5))
    runs = np.diff(np.flatnonzero(np.diff(script)))
    assert runs.min() >= LONG_PLAY.hold[0]


def test_liveliness_is_the_spread_of_codes_within_one_walk():
    swinging = np.array([[1.0, 0.0], [-1.0, 0.0]] * 10)
    assert liveliness(swinging, np.full(20, 3)) == pytest.approx(np.sqrt(0.5))
    assert liveliness(np.ones((20, 2)), np.full(20, 3)) == 0.0


def test_changes_between_walks_and_standing_do_not_count_as_liveliness():
    codes = np.repeat([[0.0], [5.0], [9.0]], 4, axis=0)
    assert liveliness(codes, np.repeat([0, 1, -1], 4)) == 0.0
    assert liveliness(codes, np.zeros(12, dtype=int)) > 0.5
    assert np.isnan(liveliness(codes, np.full(12, -1)))


def test_codes_as_they_are_encoded_are_about_one_deviation_from_their_mean():
    codes = np.random.default_rng(0).normal(size=(500, 8))
    assert distance_from_mean(codes).mean() == pytest.approx(1, abs=0.05)
    assert distance_from_mean(np.zeros((4, 0))).tolist() == [0, 0, 0, 0]
