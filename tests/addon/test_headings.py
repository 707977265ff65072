"""Headings on their way: from the picture to the Empty, into keys, and from the artist's hand."""

import json
import math

import numpy as np
import pytest
from addon.stage import BOXES, HEIGHT, WIDTH, read_png

bpy = pytest.importorskip("bpy")
from blender_addon import playables  # noqa: E402 - after the check for Blender
from blender_addon.bake import Output, bake_of, take_as_baked, take_of_moment  # noqa: E402
from blender_addon.fcurves import curves_of  # noqa: E402
from blender_addon.keyed_paths import write_bake  # noqa: E402
from blender_addon.scene_bridge import playable_objects, sample_range  # noqa: E402
from blender_addon.worker.replies import PredictedPaths  # noqa: E402
from pe_runtime.contract.errors import ShotError  # noqa: E402
from pe_runtime.worker.fake_world import FIRST_HEADING, MODELS, TURNS  # noqa: E402

pytestmark = pytest.mark.blender
LEFT = MODELS["turning"].actions.index("left")


def opened(scene, picture, model="turning"):
    bpy.ops.playable.new_environment(image=str(picture), model=model, boxes=json.dumps(BOXES))
    return playable_objects(scene)


@pytest.fixture
def players(scene, picture):
    return opened(scene, picture)


@pytest.fixture
def turned(scene, players):
    """Player 1 has gone left: a turn of 0.2 in each of the frames, of which two make a step."""
    playables.key_action(players["player_1"], 1, LEFT)
    bpy.ops.playable.bake_paths()
    return players


def rotation_keys(target):
    curve = curves_of(target).find("rotation_euler", index=2)
    return None if curve is None else [point.co[1] for point in curve.keyframe_points]


def seen(scene, name="player_1"):
    return [moment.tracks[name].heading for moment in sample_range(scene, range(1, 5))]


OUTPUT = Output(WIDTH, HEIGHT)


def take_now(scene, frame):
    bake = bake_of(scene.playable_environment)
    return take_of_moment(bake, sample_range(scene, [frame])[0], 10.0, OUTPUT)


def test_an_empty_turns_to_the_heading_that_the_picture_shows(scene, players):
    for each in players.values():
        assert each.rotation_euler.z == pytest.approx(FIRST_HEADING, abs=1e-6)
        assert each.empty_display_type == "ARROWS"
    assert seen(scene) == pytest.approx([FIRST_HEADING] * 4, abs=1e-6)


def test_predicted_headings_become_keys_on_the_turn_about_z(scene, turned):
    expected = [FIRST_HEADING + TURNS["left"] * frame / 2 for frame in range(4)]
    assert rotation_keys(turned["player_1"]) == pytest.approx(expected, abs=1e-6)
    assert rotation_keys(turned["player_2"]) == pytest.approx([FIRST_HEADING] * 4, abs=1e-6)
    assert seen(scene) == pytest.approx(expected, abs=1e-6)
    curve = curves_of(turned["player_1"]).find("rotation_euler", index=2)
    assert {point.interpolation for point in curve.keyframe_points} == {"LINEAR"}


def test_a_player_that_keeps_the_worlds_axes_gets_no_rotation_keys(scene, picture):
    players = opened(scene, picture, "fake")
    playables.key_action(players["player_1"], 1, 1)
    bpy.ops.playable.bake_paths()
    assert rotation_keys(players["player_1"]) is None
    assert take_now(scene, 2).track("player_1").headings is None


def test_headings_survive_saving_and_loading(scene, turned, tmp_path):
    before, shot = seen(scene), take_now(scene, 3)
    file = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=file)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=file)
    again = bpy.data.scenes[0]
    assert seen(again) == before
    assert take_now(again, 3).digest() == shot.digest()


def test_a_bake_from_before_there_were_headings_is_still_read(scene, picture):
    opened(scene, picture, "fake")
    bpy.ops.playable.bake_paths()
    text = scene.playable_environment.bake_text
    content = json.loads(text.as_string())
    del content["headings"]
    text.clear()
    text.write(json.dumps(content))
    assert take_now(scene, 2).track("player_1").headings is None


def test_untouched_headings_are_left_to_the_model(scene, turned):
    baked = take_as_baked(bake_of(scene.playable_environment), 4, OUTPUT)
    assert take_now(scene, 4).digest() == baked.digest()


def test_an_empty_turned_after_baking_is_drawn_so(scene, turned, addon, tmp_path):
    target = turned["player_1"]
    playables.remove_curves(target, "rotation_euler")
    target.rotation_euler.z = -1.5
    take, whole = take_now(scene, 3), bake_of(scene.playable_environment).shot
    assert take.track("player_1").headings == pytest.approx((-1.5,), abs=1e-6)
    assert take.track("player_2").headings is None
    scene.frame_set(3)
    scene.render.filepath, scene.render.image_settings.color_mode = str(tmp_path / "a.png"), "RGB"
    bpy.ops.render.render(write_still=True, scene=scene.name)
    drawn = read_png(tmp_path / "a.png")
    assert np.array_equal(drawn, addon.render(take, 3, whole=whole).rgb)
    blue = round(60 + 40 * math.sin(-1.5))
    assert (drawn == (230, 40, blue)).all(axis=-1).any()


def test_a_player_without_predicted_heading_turns_with_its_empty_all_the_same(scene, picture):
    players = opened(scene, picture, "fake")
    bpy.ops.playable.bake_paths()
    players["player_2"].rotation_euler.z = 0.7
    headings = take_now(scene, 2).track("player_2").headings
    assert headings == pytest.approx((0.7,), abs=1e-6)
    assert take_now(scene, 2).track("player_1").headings is None


def test_headings_beyond_half_a_turn_are_keyed_on_and_not_taken_for_a_turn_by_hand(scene, turned):
    scene.frame_end = 40
    bpy.ops.playable.bake_paths()
    keys = rotation_keys(turned["player_1"])
    assert keys[-1] > math.tau and np.diff(keys) == pytest.approx([0.2] * 39, abs=1e-5)
    for frame in (20, 40):
        assert take_now(scene, frame).track("player_1").headings is None


def test_a_camera_moved_after_baking_keeps_the_baked_headings(scene, turned):
    scene.camera.location.x += 1.0
    assert take_now(scene, 2).track("player_1").headings is None


def test_a_turned_root_turns_nobody_against_the_environment(scene, turned):
    root, before = scene.playable_environment.root, seen(scene)
    rigid = bpy.data.objects.new("everything", None)
    scene.collection.objects.link(rigid)
    root.parent = scene.camera.parent = rigid
    rigid.rotation_euler, rigid.scale = (0.1, 0.2, 0.7), (2, 2, 2)
    assert seen(scene) == pytest.approx(before, abs=1e-5)
    bpy.ops.playable.bake_paths()
    assert seen(scene) == pytest.approx(before, abs=1e-5)


def test_an_empty_without_parent_is_keyed_in_the_worlds_axes(scene, players):
    players["player_1"].parent = None
    scene.playable_environment.root.rotation_euler.z = 3.0
    bpy.ops.playable.bake_paths()
    assert rotation_keys(players["player_1"]) == pytest.approx([FIRST_HEADING + 3.0] * 4, abs=1e-5)
    assert seen(scene) == pytest.approx([FIRST_HEADING] * 4, abs=1e-5)


def test_headings_that_cannot_be_keyed_are_refused_and_nothing_is_keyed(scene, players):
    players["player_2"].rotation_mode = "QUATERNION"
    with pytest.raises(RuntimeError, match="set its rotation mode to XYZ Euler"):
        bpy.ops.playable.bake_paths()
    players["player_2"].rotation_mode = "XYZ"
    players["player_2"].parent = None
    scene.playable_environment.root.rotation_euler.x = 0.3
    with pytest.raises(RuntimeError, match="tilted against the environment"):
        bpy.ops.playable.bake_paths()
    assert curves_of(players["player_1"]) is None
    assert scene.playable_environment.bake_text is None


def test_headings_of_the_wrong_length_are_refused(scene, turned):
    bake = bake_of(scene.playable_environment)
    moments = sample_range(scene, range(1, 5))
    short = PredictedPaths(bake.paths, {"player_1": np.zeros(3)})
    with pytest.raises(ShotError, match="4 finite headings for 'player_1'"):
        write_bake(scene, bake.shot, short, moments)


def test_a_second_picture_of_another_model_turns_the_empties_back(scene, picture, turned):
    players = opened(scene, picture, "fake")
    assert players == turned
    assert rotation_keys(players["player_1"]) is None
    assert players["player_1"].rotation_euler.z == 0.0
