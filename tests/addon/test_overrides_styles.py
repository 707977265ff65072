"""Styles from other pictures and scenes: collected, worn, removed, refused where they misfit."""

import json
from pathlib import Path

import numpy as np
import pytest
from addon.stage import BOXES, HEIGHT, WIDTH, front_camera, picture_of

from pe_runtime.images import write_png

bpy = pytest.importorskip("bpy")
from blender_addon import playables  # noqa: E402 - after the check for Blender
from blender_addon.bake import Output, bake_of, take_of_moment  # noqa: E402
from blender_addon.scene_bridge import (  # noqa: E402
    look_through,
    playable_objects,
    sample_range,
)
from pe_runtime.contract.errors import ShotError  # noqa: E402

pytestmark = pytest.mark.blender


@pytest.fixture
def other(tmp_path):
    path = tmp_path / "kit.png"
    write_png(path, picture_of()[::-1].copy())
    return path


@pytest.fixture
def baked(environment):
    bpy.ops.playable.bake_paths()
    bpy.context.view_layer.objects.active = player(environment)
    return environment


def player(scene, name="player_1"):
    return playable_objects(scene)[name]


def styles(scene):
    return scene.playable_environment.styles


def mixes(scene, frame=2, name="player_1"):
    bake = bake_of(scene.playable_environment)
    (moment,) = sample_range(scene, [frame])
    return take_of_moment(bake, moment, 10.0, Output(WIDTH, HEIGHT)).track(name).styles


def add(scene, other, player="player_2"):
    styles(scene).camera = "SCENE"
    bpy.ops.playable.add_style(image=str(other), boxes=json.dumps({player: BOXES[player]}))


def wear(scene, number=1):
    own = player(scene).playable.overrides
    own.style, own.style_source = "PICTURE", f"S{number}"
    return own


def test_a_style_from_another_picture_is_encoded_and_worn(baked, other):
    add(baked, other)
    (source,) = styles(baked).sources
    assert (source.name, source.number, source.object_name) == ("kit", 1, "player_2")
    assert json.loads(source.text.as_string())["start"]["image"] == str(other)
    wear(baked).style_mix = 0.5
    (mix,) = mixes(baked)
    assert (mix.object, mix.weight) == ("player_2", 0.5)
    state = json.loads(Path(mix.image).read_text())
    assert state["objects"]["player_2"]["visible"] and not state["objects"]["player_1"]["visible"]
    assert mixes(baked, name="player_2") == ()


def test_the_fields_of_the_scene_say_what_is_encoded(baked, other):
    own = styles(baked)
    own.image_path, own.camera, own.box = str(other), "SCENE", BOXES["player_1"]
    bpy.ops.playable.add_style()
    own.player = "P2"
    bpy.ops.playable.add_style()
    # Without a choice it is the active object.
    assert [each.object_name for each in own.sources] == ["player_1", "player_2"]
    assert [each.name for each in own.sources] == ["kit", "kit.001"]


def test_without_a_box_the_object_is_looked_for(baked, other, addon):
    own = styles(baked)
    own.image_path, own.player = str(other), "P2"
    if addon.facts("fake").detects:
        bpy.ops.playable.add_style()
        assert own.sources[0].object_name == "player_2"
    else:
        with pytest.raises(RuntimeError, match="no detector installed.*type the box"):
            bpy.ops.playable.add_style()


@pytest.mark.parametrize(
    ("image", "boxes", "message"),
    [
        ("", "", "no picture is chosen for the style"),
        ("/nowhere.png", "", "there is no picture"),
        ("other", '{"player_9": [1, 2, 30, 40]}', "there is no 'player_9'"),
        ("other", '{"player_1": [5, 5, 5, 30]}', "no area"),
        ("other", "not json", "expected boxes as JSON"),
    ],
)
def test_what_cannot_be_encoded_is_refused_and_adds_nothing(baked, other, image, boxes, message):
    texts = len(bpy.data.texts)
    chosen = str(other) if image == "other" else image
    with pytest.raises(RuntimeError, match=message):
        bpy.ops.playable.add_style(image=chosen, boxes=boxes)
    assert not styles(baked).sources and len(bpy.data.texts) == texts


def test_without_an_environment_the_button_says_why(scene, other):
    with pytest.raises(RuntimeError, match="Make a New Playable Environment first"):
        bpy.ops.playable.add_style(image=str(other))
    with pytest.raises(RuntimeError, match="Make a New Playable Environment first"):
        bpy.ops.playable.add_scene_styles()


def test_a_removed_style_is_taken_off_and_its_number_is_never_used_again(baked, other):
    add(baked, other)
    wear(baked)
    texts = len(bpy.data.texts)
    bpy.ops.playable.remove_style()
    assert mixes(baked) == () and len(bpy.data.texts) == texts - 1
    add(baked, other)
    assert styles(baked).sources[0].number == 2
    with pytest.raises(RuntimeError, match="There is no style to remove"):
        bpy.ops.playable.remove_style()
        bpy.ops.playable.remove_style()


def test_keys_that_ask_for_a_removed_style_are_named_and_refused(baked, other, capfd):
    add(baked, other)
    wear(baked)
    player(baked).keyframe_insert("playable.overrides.style_source", frame=1)
    bpy.ops.playable.remove_style()
    assert "keys of player_1 still ask for it" in capfd.readouterr().out
    with pytest.raises(ShotError, match="a picture that was removed from Styles"):
        mixes(baked)


def test_styles_switch_between_pictures_by_keys(baked, other):
    add(baked, other)
    add(baked, other, "player_1")
    own = wear(baked, 1)
    player(baked).keyframe_insert("playable.overrides.style_source", frame=1)
    own.style_source = "S2"
    player(baked).keyframe_insert("playable.overrides.style_source", frame=3)
    found = [mixes(baked, frame)[0].object for frame in (1, 2, 3, 4)]
    assert found == ["player_2", "player_2", "player_1", "player_1"]


def test_a_style_of_another_class_or_model_is_refused(baked, other):
    add(baked, other)
    wear(baked)
    (source,) = styles(baked).sources
    content = json.loads(source.text.as_string())
    content["state"]["objects"]["player_2"]["style"] = [0.5] * 7
    playables.write_text(source.text, "", json.dumps(content))
    with pytest.raises(ShotError, match="cannot take the style of 'kit': it has 1 .*that one 7"):
        mixes(baked)
    source.model = "other.safetensors"
    with pytest.raises(ShotError, match="encoded by the model 'other.safetensors'"):
        mixes(baked)
    source.model = "fake"
    bpy.data.texts.remove(source.text)
    with pytest.raises(ShotError, match="has lost its text block; remove it and add it again"):
        mixes(baked)


def test_a_style_comes_from_the_environment_of_another_scene(baked, other):
    second = bpy.data.scenes.new("Second")
    holder = bpy.data.objects.new("Eye", bpy.data.cameras.new("Eye"))
    second.collection.objects.link(holder)
    second.camera = holder
    look_through(holder, second.render, front_camera())
    with bpy.context.temp_override(scene=second, view_layer=second.view_layers[0]):
        boxes = json.dumps(BOXES)
        bpy.ops.playable.new_environment(
            image=str(other), model="fake", boxes=boxes, camera="SCENE"
        )
    styles(baked).scene = second
    bpy.ops.playable.add_scene_styles()
    assert [each.name for each in styles(baked).sources] == ["Second player_1", "Second player_2"]
    # What the other scene does next changes nothing here.
    wear(baked, 2)
    before = mixes(baked)
    playables.write_text(second.playable_environment.state_text, "", "{}")
    assert mixes(baked) == before and before[0].object == "player_2"
    second.playable_environment.model = "turning"
    with pytest.raises(RuntimeError, match="uses the model 'turning', this one 'fake'"):
        bpy.ops.playable.add_scene_styles()


def test_the_frame_shows_the_style_of_the_other_picture(baked, other, addon):
    add(baked, other)
    bake, output = bake_of(baked.playable_environment), Output(WIDTH, HEIGHT)
    (source,) = styles(baked).sources
    content = json.loads(source.text.as_string())
    content["state"]["objects"]["player_2"]["style"] = [0.9]
    playables.write_text(source.text, "", json.dumps(content))
    drawn = []
    for weight in (0.0, 0.5, 1.0):
        wear(baked).style_mix = weight
        take = take_of_moment(bake, sample_range(baked, [2])[0], 10.0, output)
        drawn.append(addon.render(take, 2, whole=bake.shot).rgb)
    assert not np.array_equal(drawn[0], drawn[1]) and not np.array_equal(drawn[1], drawn[2])
