"""From the picture to keyed Empties and baked paths, in real Blender data."""

import json

import numpy as np
import pytest
from addon.stage import BOXES, FAKE, HEIGHT, WIDTH, front_camera, picture_of

bpy = pytest.importorskip("bpy")
from blender_addon import playables  # noqa: E402 - after the check for Blender
from blender_addon.bake import bake_of  # noqa: E402
from blender_addon.fcurves import curves_of  # noqa: E402
from blender_addon.pictures import read_picture  # noqa: E402
from blender_addon.scene_bridge import (  # noqa: E402
    action_names,
    look_through,
    playable_objects,
    read_camera,
    sample_range,
)
from pe_runtime.contract.errors import ShotError  # noqa: E402

pytestmark = pytest.mark.blender


def empty(scene, name="player_1"):
    return playable_objects(scene)[name]


def curve(target, path, index=0):
    return curves_of(target).find(path, index=index)


def test_a_picture_is_read_as_its_own_bytes(picture):
    assert np.array_equal(read_picture(str(picture)), picture_of())


def test_a_pinhole_camera_survives_the_way_through_blenders_camera(scene):
    bpy.context.view_layer.update()
    camera = read_camera(bpy.context.evaluated_depsgraph_get())
    expected = front_camera()
    assert (camera.width, camera.height) == (WIDTH, HEIGHT)
    np.testing.assert_allclose(camera.intrinsics, expected.intrinsics, rtol=1e-6)
    np.testing.assert_allclose(camera.world_from_camera, expected.world_from_camera, atol=1e-6)


def test_an_off_centre_camera_with_oblong_pixels_survives_too(scene):
    import dataclasses

    matrix = np.array([[80.0, 0.0, 25.0], [0.0, 60.0, 21.0], [0.0, 0.0, 1.0]])
    odd = dataclasses.replace(front_camera(), intrinsics=matrix)
    look_through(scene.camera, scene.render, odd)
    bpy.context.view_layer.update()
    camera = read_camera(bpy.context.evaluated_depsgraph_get())
    np.testing.assert_allclose(camera.intrinsics, matrix, rtol=1e-5)


def test_a_new_environment_places_empties_where_the_boxes_stand(environment, addon):
    state = addon.encode("fake", picture_of(), front_camera(), BOXES)
    for name in BOXES:
        each = empty(environment, name)
        assert each.parent == environment.playable_environment.root
        np.testing.assert_allclose(
            each.location, state["objects"][name]["position"], rtol=1e-5, atol=1e-6
        )
    assert environment.render.engine == "PLAYABLE_ENV"
    assert environment.view_settings.view_transform == "Standard"


def test_a_second_picture_keeps_empties_and_their_action_keys(environment, picture):
    playables.key_action(empty(environment), 2, 3)
    bpy.ops.playable.bake_paths()
    before = empty(environment)
    only_one = json.dumps({"player_1": [30, 10, 38, 31]})
    bpy.ops.playable.new_environment(image=str(picture), model="fake", boxes=only_one)
    assert playable_objects(environment) == {"player_1": before}
    assert curve(before, "playable.action") and curve(before, "location") is None
    assert environment.playable_environment.bake_text is None


@pytest.mark.parametrize(
    ("boxes", "message"),
    [
        ("not json", "expected boxes as JSON"),
        ('{"player_1": [1, 2, 3]}', "four numbers"),
        ('{"player_9": [1, 2, 3, 4]}', "there is no 'player_9'"),
        ('{"player_1": [10, 10, 10, 30]}', "no area"),
        ('{"player_1": [10, -9, 20, -2]}', "outside the picture"),
    ],
)
def test_impossible_boxes_are_refused_with_a_reason(scene, picture, boxes, message):
    with pytest.raises(RuntimeError, match=message):
        bpy.ops.playable.new_environment(image=str(picture), model="fake", boxes=boxes)
    assert scene.playable_environment.root is None


def test_a_missing_picture_and_an_unknown_model_are_refused(scene, picture):
    with pytest.raises(RuntimeError, match="there is no picture"):
        bpy.ops.playable.new_environment(image="/nowhere.png", model="fake", boxes="{}")
    with pytest.raises(RuntimeError, match="no model 'unheard'"):
        bpy.ops.playable.new_environment(image=str(picture), model="unheard", boxes="{}")


def test_loading_a_model_lists_boxes_to_type_and_the_operator_uses_them(scene, picture):
    settings = scene.playable_environment
    settings.model, settings.image_path = "fake", str(picture)
    bpy.ops.playable.load_model()
    assert [each.name for each in settings.boxes] == list(BOXES)
    settings.boxes["player_2"].box = BOXES["player_2"]
    bpy.ops.playable.new_environment()
    assert list(playable_objects(scene)) == ["player_2"]
    given = json.dumps({"player_1": BOXES["player_1"]})
    bpy.ops.playable.new_environment(boxes=given)
    assert settings.typed_boxes() == {"player_1": BOXES["player_1"]}


def test_without_a_camera_the_usual_one_is_made(scene, picture):
    bpy.data.objects.remove(scene.camera)
    box = json.dumps({"player_1": [30, 10, 38, 31]})
    bpy.ops.playable.new_environment(image=str(picture), model="fake", boxes=box)
    assert scene.camera.type == "CAMERA"
    assert (scene.render.resolution_x, scene.render.resolution_y) == (WIDTH, HEIGHT)
    assert abs(empty(scene).location.z) < 1e-5


def test_action_keys_hold_until_the_next_one(environment):
    target = empty(environment)
    environment.frame_set(1)
    bpy.context.view_layer.objects.active = target
    bpy.ops.playable.insert_action_key(action="A0")
    environment.frame_set(4)
    bpy.ops.playable.insert_action_key(action="A2")
    points = curve(target, "playable.action").keyframe_points
    assert [(p.co[0], p.co[1], p.interpolation) for p in points] == [
        (1.0, 0.0, "CONSTANT"),
        (4.0, 2.0, "CONSTANT"),
    ]
    actions = [m.tracks["player_1"].action for m in sample_range(environment, range(1, 6))]
    assert actions == [0, 0, 0, 2, 2]
    assert environment.frame_current == 4


def test_actions_carry_the_models_names_and_unknown_ones_are_refused(environment):
    target = empty(environment)
    target.playable.action = "A5"
    items = target.playable.bl_rna.properties["action"]
    assert action_names(target)[5] == "raise_arm" and items.type == "ENUM"
    with pytest.raises(ShotError, match=r"actions 0 to 5 \(idle, left"):
        playables.key_action(target, 1, 6)
    with pytest.raises(ShotError, match="not playable"):
        playables.key_action(environment.camera, 1, 0)


def test_baking_keys_the_predicted_paths_as_straight_segments(environment, addon):
    playables.key_action(empty(environment), 1, 1)
    playables.key_action(empty(environment, "player_2"), 1, 0)
    bpy.ops.playable.bake_paths()
    bake = bake_of(environment.playable_environment)
    expected = addon.rollout(bake.shot)
    for name in BOXES:
        np.testing.assert_array_equal(bake.paths[name], expected.positions[name])
        for axis in range(3):
            points = curve(empty(environment, name), "location", axis).keyframe_points
            assert {p.interpolation for p in points} == {"LINEAR"}
            path = expected.positions[name]
            np.testing.assert_allclose([p.co[1] for p in points], path[:, axis], 1e-6)
    moved = np.ptp(bake.paths["player_1"], axis=0)
    assert moved[0] > 0.1 and np.ptp(bake.paths["player_2"], axis=0).max() == 0.0


def test_the_animated_camera_and_the_root_reach_the_worker_in_environment_space(environment):
    root = environment.playable_environment.root
    bpy.ops.playable.bake_paths()
    plain = bake_of(environment.playable_environment)
    # The whole set moved, turned and doubled: nothing changes as seen from the environment.
    rigid = bpy.data.objects.new("everything", None)
    environment.collection.objects.link(rigid)
    root.parent = environment.camera.parent = rigid
    rigid.location, rigid.rotation_euler, rigid.scale = (5, -3, 1), (0, 0, 0.7), (2, 2, 2)
    bpy.ops.playable.bake_paths()
    moved = bake_of(environment.playable_environment)
    for a, b in zip(plain.shot.cameras, moved.shot.cameras, strict=True):
        np.testing.assert_allclose(a.world_from_camera, b.world_from_camera, atol=1e-5)
    np.testing.assert_allclose(plain.paths["player_1"], moved.paths["player_1"], atol=1e-5)


def test_a_stretched_root_is_refused(environment):
    environment.playable_environment.root.scale = (1, 2, 1)
    with pytest.raises(RuntimeError, match="stretched or mirrored"):
        bpy.ops.playable.bake_paths()


def test_two_empties_for_one_player_are_refused(environment):
    copy = empty(environment).copy()
    environment.collection.objects.link(copy)
    with pytest.raises(RuntimeError, match="both stand for 'player_1'"):
        bpy.ops.playable.bake_paths()


def test_baking_a_duplicate_leaves_the_original_alone(environment):
    playables.key_action(empty(environment), 1, 1)
    bpy.ops.playable.bake_paths()
    original = empty(environment)
    copy = original.copy()
    environment.collection.objects.link(copy)
    assert copy.animation_data.action == original.animation_data.action
    original.playable.is_playable = False
    playables.key_action(copy, 1, 2)
    bpy.ops.playable.bake_paths()
    assert copy.animation_data.action != original.animation_data.action
    assert curve(original, "playable.action").keyframe_points[0].co[1] == 1
    assert curve(copy, "playable.action").keyframe_points[0].co[1] == 2


def test_a_bake_survives_saving_and_loading(environment, addon, tmp_path):
    bpy.ops.playable.bake_paths()
    digest = bake_of(environment.playable_environment).shot.digest()
    file = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=file)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=file)
    scene = bpy.data.scenes[0]
    assert bake_of(scene.playable_environment).shot.digest() == digest
    assert list(playable_objects(scene)) == list(BOXES)


def test_a_bake_edited_by_hand_is_refused(environment):
    bpy.ops.playable.bake_paths()
    text = environment.playable_environment.bake_text
    changed = text.as_string().replace('"frame_end": 4', '"frame_end":  4').replace("10.0", "11.0")
    text.clear()
    text.write(changed)
    with pytest.raises(ShotError, match="was edited since it was baked"):
        bake_of(environment.playable_environment)


def test_baking_without_an_environment_explains_itself(scene):
    with pytest.raises(RuntimeError, match="Make a New Playable Environment first"):
        bpy.ops.playable.bake_paths()


def test_stopping_the_worker_is_possible_and_the_next_bake_starts_another(environment, addon):
    first = addon.worker_pid
    bpy.ops.playable.stop_worker()
    assert addon.worker_pid is None
    bpy.ops.playable.bake_paths()
    assert addon.worker_pid not in (None, first)
    assert addon._command == FAKE
