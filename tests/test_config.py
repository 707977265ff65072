import json
import re
from dataclasses import dataclass, replace

import pytest
from small_world import small_config

from pe_runtime.config import (
    QUALITIES,
    BendingConfig,
    FeatureRendererConfig,
    ModelConfig,
    ObjectClassConfig,
    SynthesisConfig,
    as_dict,
    from_dict,
    read_toml,
)
from pe_runtime.contract.errors import ConfigError
from pe_runtime.environment import MODELS


def read(text, tmp_path, section="synthesis", kind=SynthesisConfig):
    path = tmp_path / "settings.toml"
    path.write_text(text)
    return read_toml(path, section, kind)


@pytest.mark.parametrize("players", [0, 2])
def test_a_model_survives_json(players):
    config = small_config(players)
    assert from_dict(ModelConfig, json.loads(json.dumps(as_dict(config)))) == config


def test_the_built_in_settings_are_read_and_survive_json():
    config = read_toml(MODELS / "duel.toml", "model", ModelConfig)
    assert config.playable_names == ("player_1", "player_2")
    assert config.class_of("player_1") is config.class_of("player_2")
    assert isinstance(config.classes["player"].bending, BendingConfig)
    assert config.classes["ground"].bending is None
    assert from_dict(ModelConfig, json.loads(json.dumps(as_dict(config)))) == config
    read_toml(MODELS / "duel.toml", "synthesis", SynthesisConfig)


def test_a_file_without_the_section_gives_the_defaults(tmp_path):
    assert read("[other]\nx = 1", tmp_path) == SynthesisConfig()


def test_whole_numbers_serve_as_floats_but_not_the_other_way_round(tmp_path):
    assert read("[synthesis]\nclip = 2", tmp_path).clip == 2.0
    with pytest.raises(ConfigError, match=r"synthesis\.steps.*int.*2\.5"):
        read("[synthesis]\nsteps = 2.5", tmp_path)


def test_an_unknown_key_names_the_nearest_known_one(tmp_path):
    with pytest.raises(ConfigError, match="synthesis: unknown key 'learning_rat'.*learning_rate"):
        read("[synthesis]\nlearning_rat = 0.1", tmp_path)


def test_an_unknown_key_deep_inside_says_where(tmp_path):
    text = "[model.classes.player.field]\nwidht = 3"
    with pytest.raises(ConfigError, match=r"model\.classes\.player\.field.*'widht'.*'width'"):
        read(text, tmp_path, "model", ModelConfig)


def test_a_key_like_no_other_lists_the_known_ones(tmp_path):
    with pytest.raises(ConfigError, match="known: .*steps.*seed"):
        read("[synthesis]\nzzz = 3", tmp_path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("steps = true", "steps.*int.*True"),
        ("steps = '3'", "steps.*int.*'3'"),
        ("clip = nan", "clip.*finite"),
        ("clip = inf", "clip.*finite"),
        ("permute_style = 1", "permute_style.*bool"),
    ],
)
def test_a_value_of_a_wrong_kind_names_its_key(text, message, tmp_path):
    with pytest.raises(ConfigError, match=message):
        read(f"[synthesis]\n{text}", tmp_path)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"low": [1.0, 2.0]}, r"low.*3 values.*2"),
        ({"low": 1.0}, r"low.*list"),
        ({"low": [1.0, 2.0, "x"]}, r"low\[2\].*float"),
        ({"axes": [0, 1.5]}, r"axes\[1\].*int"),
        ({"encoder": 3}, r"encoder.*table"),
        ({"bending": [1]}, r"bending.*table"),
    ],
)
def test_a_malformed_part_of_a_class_names_its_place(values, message):
    with pytest.raises(ConfigError, match=message):
        from_dict(ObjectClassConfig, values)


def test_a_missing_key_is_named():
    with pytest.raises(ConfigError, match="missing key 'class_name'"):
        from_dict(ModelConfig, {"objects": [{"name": "a"}]})


def test_no_bending_at_all_is_a_value():
    assert from_dict(ObjectClassConfig, {"bending": None}).bending is None


@pytest.mark.parametrize("text", ["[synthesis", "\x00", "x = "])
def test_a_file_that_is_no_toml_is_one_clear_error(text, tmp_path):
    with pytest.raises(ConfigError, match="settings.toml"):
        read(text, tmp_path)


def test_a_file_that_is_not_there_is_one_clear_error(tmp_path):
    with pytest.raises(ConfigError, match="nowhere.toml"):
        read_toml(tmp_path / "nowhere.toml", "model", ModelConfig)


def test_a_file_of_bytes_is_one_clear_error(tmp_path):
    (tmp_path / "settings.toml").write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(ConfigError, match="settings.toml"):
        read_toml(tmp_path / "settings.toml", "model", ModelConfig)


@pytest.mark.parametrize("value", [3, "players", [1, 2]])
def test_classes_that_are_no_table_are_one_clear_error(value):
    with pytest.raises(ConfigError, match="classes"):
        from_dict(ModelConfig, {"classes": value})


def test_an_unknown_object_names_the_known_ones():
    with pytest.raises(ConfigError, match="'player_9'.*ground.*player_1"):
        small_config().class_of("player_9")


def test_playable_objects_are_those_of_playable_classes_in_order():
    assert small_config(3).playable_names == ("player_1", "player_2", "player_3")
    assert small_config(0).playable_names == ()
    assert ModelConfig().playable_names == ()


def test_configurations_cannot_be_changed():
    with pytest.raises(AttributeError):
        SynthesisConfig().steps = 3


def test_exact_quality_skips_nothing_that_matters():
    exact = QUALITIES["exact"]
    assert (exact.weight_threshold, exact.sample_share, exact.bfloat16) == (0.0, 1.0, False)
    assert QUALITIES.keys() == {"exact", "balanced", "draft"}


@dataclass(frozen=True)
class Nested:
    pair: tuple[int, str] = (1, "a")
    many: tuple[float, ...] = ()


def test_tuples_of_several_kinds_and_of_any_length_are_read():
    assert from_dict(Nested, {"pair": [2, "b"], "many": [1, 2.5]}) == Nested((2, "b"), (1.0, 2.5))
    assert replace(Nested(), many=()) == from_dict(Nested, {"many": []})


@pytest.mark.parametrize(
    ("kind", "values", "told"),
    [
        (ObjectClassConfig, {"kind": "playble"}, "playable, static, sky"),
        (ObjectClassConfig, {"samples": -3}, "samples >= 1"),
        (ObjectClassConfig, {"low": [0.0, 0.0, 3.0]}, "low below high"),
        (ObjectClassConfig, {"axes": [0, 3]}, "axes"),
        (ObjectClassConfig, {"bending": {}, "pose_features": 0}, "pose_features"),
        (ObjectClassConfig, {"field": {"depth": 2, "skip": 2}}, "skip"),
        (ObjectClassConfig, {"encoder": {"crop": "boxes"}}, "crop one of"),
        (ObjectClassConfig, {"encoder": {"channels": [6]}}, "multiples of 4"),
        (FeatureRendererConfig, {"strides": [2, 4, 8]}, "one entry a map"),
        (FeatureRendererConfig, {"strides": [2, 6]}, "twice the one before"),
        (FeatureRendererConfig, {"strides": [4, 8]}, "doublings"),
        (ModelConfig, {"objects": [{"name": "a", "class_name": "b"}]}, "'b'"),
        (ModelConfig, {"steps_per_second": 0.0}, "steps_per_second"),
        (SynthesisConfig, {"patch_width": 8}, "16 pixels"),
    ],
)
def test_settings_that_make_no_sense_are_refused_by_name(kind, values, told):
    with pytest.raises(ConfigError, match=re.escape(told)):
        from_dict(kind, values)
