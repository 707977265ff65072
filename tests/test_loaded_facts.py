"""What models say of themselves: names, rest, headings, volumes, cameras, terms."""

from dataclasses import replace

import numpy as np
import pytest
import tiny_model

from pe_runtime.action.module import ActionModule
from pe_runtime.config import read_toml
from pe_runtime.config.model import ModelConfig
from pe_runtime.config.objects import EncoderConfig
from pe_runtime.contract.camera import project
from pe_runtime.contract.errors import CheckpointError
from pe_runtime.contract.model_facts import Volume
from pe_runtime.environment import MODELS, PlayableEnvironment
from pe_runtime.interop.official_entries import official_config
from pe_runtime.networks import SynthesisNetworks
from pe_runtime.shots.clips import start_from_clip
from pe_runtime.worker.loaded_facts import facts_of, turning_names
from pe_runtime.worker.usual_cameras import usual_camera

NAMES = ("forward", "left", "right")


def loaded(config=None, acting=True, names=NAMES, **header):
    """An untrained environment; its players have actions unless told otherwise."""
    config = config or tiny_model.tiny_config()
    classes = {n: c for n, c in config.classes.items() if c.kind == "playable" and acting}
    actions = {
        n: ActionModule(config.action, c.style_features, c.pose_features)
        for n, c in classes.items()
    }
    header["action_names"] = dict.fromkeys(config.classes, names)
    return PlayableEnvironment(config, SynthesisNetworks(config), actions, header)


@pytest.mark.parametrize(
    ("names", "movements", "rest"),
    [
        (("left", "idle", "stay"), [], 1),
        (("left", "right", "stay"), [9, 1, 5], 2),
        (NAMES, [0.3, -0.1, 0.2], 1),
        (NAMES, [0.3, 0.1], 0),
        (NAMES, [], 0),
    ],
)
def test_rest_is_known_by_name_or_by_how_little_an_action_moves(names, movements, rest):
    described = [{"name": "x", "movement": [0.0, each]} for each in movements]
    world = loaded(names=names, actions={"player": described})
    assert facts_of(world).resting_actions == dict.fromkeys(tiny_model.PLACES, rest)


def test_a_model_without_action_module_has_no_actions_whatever_its_names_say():
    facts = facts_of(loaded(acting=False))
    assert facts.action_names == {"player_1": (), "player_2": ()}
    assert facts.resting_actions == {}


def test_trained_actions_without_names_are_numbered():
    facts = facts_of(loaded(names=()))
    assert facts.action_names["player_1"] == ("action_1", "action_2", "action_3")


def test_headings_are_seen_by_an_encoder_or_predicted_by_the_dynamics():
    config = tiny_model.tiny_config()
    assert turning_names(loaded(config)) == ()
    turning = replace(config.action, sees_heading=True, predict_heading=True)
    predicts = replace(config, action=turning)
    assert turning_names(loaded(predicts)) == config.playable_names
    assert turning_names(loaded(predicts, acting=False)) == ()
    look = EncoderConfig(design="residual", crop="box", height=16, width=16, channels=(4, 4))
    seen = replace(config.classes["player"], heading=look)
    sees = replace(config, classes={**config.classes, "player": seen})
    assert turning_names(loaded(sees, acting=False)) == config.playable_names


@pytest.mark.parametrize(
    ("described", "wanted"),
    [
        ([(0.3, 0.1), (-0.2, 0.0), (0.0, 0.0)], ((0.3, 0.1), (-0.2, 0.0), (0.0, 0.0))),
        ([(0.3, 0.1)], ()),
        ([], ()),
    ],
)
def test_movements_are_those_of_the_header_if_it_has_all(described, wanted):
    header = {"actions": {"player": [{"name": "x", "movement": list(each)} for each in described]}}
    assert facts_of(loaded(**header)).movements == dict.fromkeys(tiny_model.PLACES, wanted)


def test_the_envelope_of_the_header_is_passed_on_and_nonsense_is_refused():
    spans = {"camera_heights": [1, 2], "camera_distances": [3, 4], "camera_pitches": [-9, 0]}
    spans |= {"fields_of_view": [40, 50], "box_heights": [0.1, 0.5], "positions": [[0, 0], [1, 2]]}
    assert facts_of(loaded()).envelope is None
    assert facts_of(loaded(envelope=spans)).envelope.positions == ((0.0, 0.0), (1.0, 2.0))
    for wrong in ({}, [], spans | {"box_heights": [0.5, 0.1]}):
        with pytest.raises(CheckpointError, match="training data"):
            facts_of(loaded(envelope=wrong))


def test_the_device_is_told_in_words_and_the_detector_is_there():
    facts = facts_of(loaded(), "ab")
    assert (facts.device, facts.digest, facts.detects) == ("cpu", "ab", True)


def test_the_envelope_of_the_builtin_model_holds_its_usual_camera_and_its_clip():
    facts = facts_of(PlayableEnvironment.load("duel", "cpu"))
    start = start_from_clip(MODELS / "duel_clip")
    for camera in (facts.usual_camera, start.camera):
        low, high = facts.envelope.camera_heights
        assert low < camera.world_from_camera[2, 3] < high
        pitch = np.degrees(np.arcsin(camera.world_from_camera[2, 2]))
        assert facts.envelope.camera_pitches[0] < pitch < facts.envelope.camera_pitches[1]
        angle = np.degrees(2 * np.arctan(camera.width / 2 / camera.intrinsics[0, 0]))
        assert facts.envelope.fields_of_view[0] < angle < facts.envelope.fields_of_view[1]
    for _, top, _, bottom in start.boxes.values():
        low, high = facts.envelope.box_heights
        assert low < (bottom - top) / start.camera.height < high


def test_terms_of_imported_weights_are_passed_on():
    assert facts_of(loaded()).licence == ""
    imported = {"world": "tennis", "licence": "CC BY-NC 4.0"}
    assert facts_of(loaded(imported=imported)).licence == "CC BY-NC 4.0"


def test_volumes_are_those_of_the_classes_and_the_sky_has_none():
    config = official_config("minecraft")
    facts = facts_of(loaded(config, acting=False))
    assert facts.volumes["player_2"] == Volume((-0.6, -1.2, 0.0), (0.6, 1.2, 2.1))
    assert set(facts.volumes) == {"arena", "player_1", "player_2"}
    assert (facts.name, facts.width, facts.height) == ("official-minecraft", 512, 288)


def test_the_builtin_model_is_told_as_it_is():
    facts = facts_of(PlayableEnvironment.load("duel", "cpu"))
    assert facts.action_names["player_2"][facts.resting_actions["player_2"]] == "idle"
    assert facts.turning_names == () and facts.licence == ""


def world_config(name):
    if name == "duel":
        return read_toml(MODELS / "duel.toml", "model", ModelConfig)
    return official_config(name)


@pytest.mark.parametrize(
    ("world", "places"),
    [
        ("duel", [(-2.0, -1.5, 0.0), (2.0, 1.5, 0.0)]),
        ("tennis", [(-4.0, -12.0, 0.0), (4.0, -12.0, 0.0), (-4.0, 12.5, 0.0), (4.0, 12.5, 0.0)]),
        ("minecraft", [(-4.0, -2.0, 0.0), (4.0, -2.0, 0.0), (-6.0, 6.0, 0.0), (6.0, 6.0, 0.0)]),
    ],
)
def test_the_usual_camera_is_level_and_shows_where_players_stand(world, places):
    config = world_config(world)
    camera = usual_camera(config)
    assert (camera.width, camera.height) == (config.width, config.height)
    assert abs(camera.world_from_camera[2, 0]) < 1e-12
    feet = np.array(places)
    heads = feet + [0.0, 0.0, 2.15]
    pixels, depth = project(camera, np.concatenate([feet, heads]))
    assert (depth > 0).all()
    assert (pixels >= 0).all() and (pixels <= [config.width, config.height]).all()
    tall = pixels[: len(feet), 1] - pixels[len(feet) :, 1]
    assert (tall > 0.05 * config.height).all()
