"""What is typed and pressed while playing, and what a model says of its actions."""

import math

import pytest
import small_world
import torch

from pe_runtime.contract.errors import CheckpointError, ShotError
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.play import learnt_actions, parse_styles
from pe_runtime.play.commands import (
    KEYS,
    Command,
    command_of_key,
    commands_of_word,
    words_of_line,
)
from pe_runtime.play.learnt_actions import LearntAction, resting_action
from pe_runtime.play.session import CHANGES
from pe_runtime.shots.action_text import keys_of, parse_actions, steps_of
from pe_runtime.state import EnvironmentState, ObjectState, move

NAMES = {"player_1": ("idle", "left", "raise_arm"), "player_2": ("idle",)}
ACTIONS = NAMES["player_1"]


def test_actions_are_read_into_runs_and_keys_at_the_frames_of_their_steps():
    runs = parse_actions(" player_1 = left*2 , raise_arm ; player_2=idle*5 ", NAMES)
    assert runs == {"player_1": [(1, 2), (2, 1)], "player_2": [(0, 5)]}
    assert steps_of(runs) == 5
    # At 12 frames and 5 steps a second step 2 is taken at frame 1 + 4.8: the key stands at 5.
    assert keys_of(runs["player_1"], 1, 12 / 5) == ((1, 1), (5, 2))
    with pytest.raises(ShotError, match="once"):
        parse_actions("player_1=left;player_1=idle", NAMES)


def test_numbers_count_from_one_and_players_stand_in_the_models_order():
    assert parse_actions("2*5,3*8;1*13", NAMES) == {
        "player_1": [(1, 5), (2, 8)],
        "player_2": [(0, 13)],
    }
    assert parse_actions("left, 3 * 2", NAMES) == {"player_1": [(1, 1), (2, 2)]}
    assert parse_actions("player_2=1*4;player_1=2", NAMES) == {
        "player_2": [(0, 4)],
        "player_1": [(1, 1)],
    }


def test_an_empty_part_leaves_its_player_without_actions():
    assert parse_actions(";1*13", NAMES) == {"player_2": [(0, 13)]}
    assert parse_actions("2;", NAMES) == {"player_1": [(1, 1)]}


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("4*2", "no action '4', this model has 1 idle, 2 left, 3 raise_arm"),
        ("0", "no action '0'"),
        ("1;2", "no action '2', this model has 1 idle"),
        ("1;1;1", "for 3 players, this model has 2: player_1, player_2"),
        ("1*0", "1 step or more"),
        ("1,,2", "no action ''"),
        ("lift", "did you mean 'left'"),
        (";", "expected '2"),
        ("player_1=left;2", "each object once"),
    ],
)
def test_a_script_that_cannot_be_read_says_what_there_is(text, named):
    with pytest.raises(ShotError) as problem:
        parse_actions(text, NAMES)
    assert named in str(problem.value)


def test_a_number_that_is_an_actions_name_means_that_action():
    assert parse_actions("1", {"player": ("2", "1")}) == {"player": [(1, 1)]}


def test_digits_letters_and_arrows_are_commands():
    assert command_of_key("3", ACTIONS) == Command("act", 2)
    assert command_of_key("a", ACTIONS) == command_of_key("←", ACTIONS) == Command("orbit", -1)
    assert command_of_key("space", ACTIONS) == Command("again")
    for key, named in (("z", "? shows the keys"), ("4", "1 idle, 2 left"), ("²", "no key")):
        with pytest.raises(ShotError) as problem:
            command_of_key(key, ACTIONS)
        assert named in str(problem.value)


def test_typed_words_are_actions_keys_or_names_of_commands():
    assert words_of_line(" 1  left*2, q\n") == ["1", "left*2", "q"]
    assert commands_of_word("left*2", ACTIONS) == (Command("act", 1),) * 2
    assert commands_of_word("3", ACTIONS) == (Command("act", 2),)
    assert commands_of_word("Undo", ACTIONS) == commands_of_word("u", ACTIONS) == (Command("undo"),)
    with pytest.raises(ShotError, match="raise_arm, or their numbers 1 to 3; words: again"):
        commands_of_word("jump", ACTIONS)


def test_no_key_or_word_has_two_meanings_and_every_command_has_a_meaning():
    keys = [key for each in KEYS for key in each.keys]
    words = [word for each in KEYS for word in each.words]
    assert len({*keys, *words}) == len(keys) + len(words)
    assert not any(key.isdecimal() for key in keys)
    doors = {"film", "keys", "quit"}
    assert {each.command.verb for each in KEYS} | {"act"} == {*CHANGES, *doors}


def test_styles_are_read_with_and_without_their_weight():
    styles = parse_styles(["player_1=player_2:0.7", "player_2 = player_1"], tuple(NAMES))
    assert [(n, mix.object, mix.weight) for n, mix in styles.items()] == [
        ("player_1", "player_2", 0.7),
        ("player_2", "player_1", 1.0),
    ]
    assert parse_styles(["player_1=player_2;player_2=player_1"], tuple(NAMES)).keys() == {*NAMES}
    assert all(mix.image is None and mix.frame == 1 for mix in styles.values())


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("player_1", "expected 'player_1=player_2:0.7'"),
        ("player_1=player_2:2", "weight from 0 to 1"),
        ("player_1=player_2:much", "weight from 0 to 1"),
        ("player_1=player_2:nan", "weight from 0 to 1"),
        ("player_1=player_2;player_1=player_1", "each player once"),
        ("player_1=playr_2", "did you mean 'player_2'"),
        ("sky=player_2", "no player 'sky', there are player_1, player_2"),
    ],
)
def test_a_style_that_cannot_be_read_says_what_there_is(text, named):
    with pytest.raises(ShotError) as problem:
        parse_styles([text], tuple(NAMES))
    assert named in str(problem.value)


@pytest.mark.parametrize(
    ("movement", "arrow"),
    [
        ((0.3, 0.0), "→"),
        ((0.0, 0.3), "↑"),
        ((-0.2, 0.2), "↖"),
        ((0.0, -0.3), "↓"),
        ((0.0, 0.0), ""),
    ],
)
def test_arrows_point_where_actions_lead_in_the_picture(movement, arrow):
    view = small_world.camera(azimuth=1.1)
    assert LearntAction("walk", movement).arrow(view, heading=0.7) == arrow


def test_arrows_of_other_frames_turn_with_the_camera_and_the_player():
    front, side = small_world.camera(azimuth=0.0), small_world.camera(azimuth=math.pi / 2)
    along_x = LearntAction("walk", (1.0, 0.0), "world")
    # From the side of +x the camera looks along -x: what goes along +x comes towards it.
    assert [along_x.arrow(view, 0.0) for view in (front, side)] == ["→", "↓"]
    ahead = LearntAction("walk", (0.0, 1.0), "object")
    assert [ahead.arrow(front, heading) for heading in (0.0, math.pi / 2)] == ["↑", "←"]


def test_learnt_actions_have_the_names_and_arrows_of_the_models_file():
    world = small_world.small_environment()
    moves = [(0.0, 0.1), (-0.3, 0.0), (0.3, 0.0)]
    world.header = world.header | {"actions": {"player": [{"movement": each} for each in moves]}}
    wanted = tuple(map(LearntAction, ("idle", "left", "right"), ((0.0, 0.0), *moves[1:])))
    assert learnt_actions(world) == {"player_1": wanted, "player_2": wanted}
    del world.header["actions"]
    assert {each.movement for each in learnt_actions(world)["player_1"]} == {(0.0, 0.0)}


def test_actions_without_names_are_numbered():
    world = small_world.small_environment()
    world.action_names = dict.fromkeys(world.playable_names, ())
    names = [each.name for each in learnt_actions(world)["player_2"]]
    assert names == ["action_1", "action_2", "action_3"]


def test_a_model_that_cannot_be_played_says_what_to_do():
    with pytest.raises(CheckpointError, match="pe train actions"):
        learnt_actions(small_world.small_environment(actions=False))
    with pytest.raises(CheckpointError, match="no playable objects"):
        learnt_actions(small_world.small_environment(small_world.small_config(players=0)))


class Walks(PlayableEnvironment):
    """A model in which each action goes a known way."""

    def __init__(self, *lengths):
        vars(self).update(vars(small_world.small_environment()))
        self.lengths = lengths

    def step(self, state, actions, camera, memory=None):
        ((name, action),) = actions.items()
        return move(state, name, state[name].position + self.lengths[action]), None


def test_rest_is_known_by_name_else_the_action_that_goes_the_least_far():
    place = ObjectState(torch.zeros(3), torch.zeros(5), torch.zeros(3))
    state, view = EnvironmentState({"player_1": place}), small_world.camera()
    world = Walks(0.5, -0.1, 0.3)
    assert resting_action(world, state, view, "player_1", ("a", "b", "c")) == 1
    assert resting_action(world, state, view, "player_1", ("a", "b", "idle")) == 2
    assert resting_action(world, state, view, "player_1", ("stay", "b", "c")) == 0
