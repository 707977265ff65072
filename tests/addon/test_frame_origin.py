"""What picture files say of their frames: model, encoded picture, actions and camera."""

import dataclasses
import json

import OpenImageIO as oiio  # noqa: N813 its own documentation's name
import pytest
from addon.stage import render_layers

bpy = pytest.importorskip("bpy")
from blender_addon import playables  # noqa: E402 - after the check for Blender
from blender_addon.bake import bake_of  # noqa: E402
from blender_addon.filming.frame_origin import PREFIX, state_digest  # noqa: E402
from blender_addon.scene_bridge import playable_objects  # noqa: E402
from blender_addon.state_files import file_name, stored_state  # noqa: E402
from pe_runtime.contract.shot import Start  # noqa: E402

pytestmark = pytest.mark.blender


@pytest.fixture
def baked(environment):
    for frame, action in ((1, 1), (3, 2)):
        playables.key_action(playable_objects(environment)["player_1"], frame, action)
    bpy.ops.playable.bake_paths()
    return environment


def said_by(path):
    """The fields of ours in a file, by name."""
    source = oiio.ImageInput.open(str(path))
    fields = {each.name: each.value for each in source.spec().extra_attribs}
    return {n.removeprefix(PREFIX): said for n, said in fields.items() if n.startswith(PREFIX)}


def render_range(scene, folder):
    scene.render.filepath = str(folder / "frame_####")
    bpy.ops.render.render(animation=True, scene=scene.name)
    return sorted(folder.glob("frame_*.png"))


def test_each_file_says_which_model_picture_actions_and_camera_made_it(baked, addon, tmp_path):
    said = [said_by(path) for path in render_range(baked, tmp_path)]
    settings, facts = baked.playable_environment, addon.facts("fake")
    block, bake = settings.state_text, bake_of(settings)
    assert [each["model"] for each in said] == [f"{facts.name} {facts.digest}"] * 4
    state = file_name(stored_state(block.as_string(), block.name)).removesuffix(".json")
    assert [each["state"] for each in said] == [state] * 4
    assert [each["quality"] for each in said] == ["exact"] * 4
    actions = [json.loads(each["actions"]) for each in said]
    assert [each["player_1"] for each in actions] == [1, 1, 2, 2]
    cameras = [json.loads(each["camera"]) for each in said]
    assert cameras == [each.as_dict() for each in bake.shot.cameras]


def test_a_multilayer_exr_says_it_too_and_more_view_layers_say_it_once(baked, tmp_path):
    png = said_by(render_range(baked, tmp_path)[0])
    baked.view_layers.new("Second")
    baked.frame_set(1)
    assert said_by(render_layers(baked, tmp_path / "layers.exr")) == png


def test_a_job_and_render_animation_write_the_same_words(baked, tmp_path):
    of_animation = [said_by(path) for path in render_range(baked, tmp_path / "animation")]
    bpy.ops.playable.render_range(folder=str(tmp_path / "job"))
    assert [said_by(path) for path in sorted((tmp_path / "job").glob("*.png"))] == of_animation


def test_a_file_whose_words_would_be_others_is_rendered_again(baked, tmp_path):
    resumed, anew = tmp_path / "resumed", tmp_path / "anew"
    bpy.ops.playable.render_range(folder=str(resumed))
    playables.key_action(playable_objects(baked)["player_2"], 3, 3)
    bpy.ops.playable.bake_paths()
    bpy.ops.playable.render_range(folder=str(resumed))
    bpy.ops.playable.render_range(folder=str(anew))
    assert [path.read_bytes() for path in sorted(resumed.glob("*.png"))] == [
        path.read_bytes() for path in sorted(anew.glob("*.png"))
    ]


def test_a_shot_that_starts_from_a_picture_has_no_digest_of_its_state_yet(baked):
    shot = bake_of(baked.playable_environment).shot
    assert len(state_digest(shot)) == 64
    picture = Start(image="/a.png", camera=shot.cameras[0], boxes={})
    assert state_digest(dataclasses.replace(shot, start=picture)) == ""
