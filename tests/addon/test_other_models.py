"""Models unlike the built-in one: without actions, with other ranks of them, with terms."""

import json

import numpy as np
import pytest
from addon.stage import BOXES, HEIGHT, WIDTH, front_camera, picture_of, read_png

from blender_addon.worker.session import Session

bpy = pytest.importorskip("bpy")
from blender_addon import playables  # noqa: E402 - after the check for Blender
from blender_addon.bake import bake_of  # noqa: E402
from blender_addon.fcurves import curves_of  # noqa: E402
from blender_addon.scene_bridge import (  # noqa: E402
    action_names,
    look_through,
    playable_objects,
    read_camera,
    sample_range,
    wanted_passes,
)
from blender_addon.settings import action_items  # noqa: E402
from blender_addon.strips.job import job_for  # noqa: E402
from blender_addon.strips.lending import lent_settings  # noqa: E402
from blender_addon.volumes import VOLUME_KEY  # noqa: E402
from pe_runtime.images import write_png  # noqa: E402
from pe_runtime.worker.fake_world import GROUND, MODELS, PLAYER  # noqa: E402

pytestmark = pytest.mark.blender


def opened(scene, picture, model, **options):
    boxes = json.dumps(BOXES)
    bpy.ops.playable.new_environment(image=str(picture), model=model, boxes=boxes, **options)
    return playable_objects(scene)


def volumes(scene):
    return {each[VOLUME_KEY]: each for each in scene.objects if VOLUME_KEY in each}


def corners(box):
    bpy.context.view_layer.update()
    points = np.array([box.matrix_world @ each.co for each in box.data.vertices])
    return points.min(axis=0), points.max(axis=0)


def test_a_model_without_actions_is_filmed_where_the_artist_moves_it(scene, picture, tmp_path):
    target = opened(scene, picture, "still")["player_1"]
    start = target.location.copy()
    target.keyframe_insert("location", frame=1)
    target.location.x += 1.5
    target.keyframe_insert("location", frame=4)
    bpy.ops.playable.bake_paths()
    assert bake_of(scene.playable_environment).shot.track("player_1").actions == ()
    points = curves_of(target).find("location", index=0).keyframe_points
    assert [point.co[0] for point in points] == [1.0, 4.0]
    assert [point.co[1] for point in points] == pytest.approx([start.x, start.x + 1.5])
    bpy.ops.playable.render_to_sequencer(folder=str(tmp_path))
    first, last = (read_png(tmp_path / f"frame_000{n}.png")[..., 0] == 230 for n in (1, 4))
    assert np.flatnonzero(last.any(axis=0)).min() > np.flatnonzero(first.any(axis=0)).min()


def test_a_model_without_actions_says_so_where_they_would_be_keyed(scene, picture):
    target = opened(scene, picture, "still")["player_1"]
    assert action_names(target) == []
    bpy.context.view_layer.objects.active = target
    with pytest.raises(RuntimeError, match="The model has no actions for it"):
        bpy.ops.playable.insert_action_key(action="A0")
    with pytest.raises(playables.ShotError, match="no actions for 'player_1': move 'player_1'"):
        playables.key_action(target, 1, 0)


@pytest.mark.parametrize("model", ["fake", "turning"])
def test_a_player_without_keys_rests_whatever_number_resting_has(scene, picture, model):
    target = opened(scene, picture, model)["player_1"]
    rest = MODELS[model].actions.index("idle")
    bpy.ops.playable.bake_paths()
    bake = bake_of(scene.playable_environment)
    assert bake.shot.track("player_1").actions == ((1, rest),)
    assert np.ptp(bake.paths["player_1"], axis=0).max() == 0.0
    assert target.playable.action == f"A{rest}"


def test_actions_of_another_model_are_taught_and_those_of_the_same_are_kept(scene, picture):
    target = opened(scene, picture, "fake")["player_1"]
    target.playable.action = "A3"
    assert opened(scene, picture, "fake")["player_1"].playable.action == "A3"
    assert opened(scene, picture, "turning")["player_1"] == target
    assert target.playable.action == "A5" and action_names(target)[5] == "idle"


def test_as_many_actions_are_offered_as_the_model_has(scene, picture):
    target = opened(scene, picture, "fake")["player_1"]
    labels = [item[1] for item in action_items(target.playable.action_names)]
    assert labels == ["Idle", "Left", "Right", "Forward", "Back", "Raise arm"]
    many = action_items(json.dumps([f"a_{n}" for n in range(40)]))
    assert [item[3] for item in many] == list(range(40)) and many[39][:2] == ("A39", "A 39")
    assert len(action_items("")) == len(action_items("[]")) > 0


def test_a_key_beyond_the_models_actions_is_refused_with_those_it_has(scene, picture):
    target = opened(scene, picture, "fake")["player_1"]
    playables.key_action(target, 1, 5)
    target.playable.action_names = json.dumps(["idle", "left"])
    with pytest.raises(RuntimeError, match=r"beyond the model's 2 actions \(idle, left\)"):
        bpy.ops.playable.bake_paths()


def test_the_panel_can_tell_size_pace_and_terms_without_a_worker(scene, addon):
    settings = scene.playable_environment
    settings.model = "turning"
    assert tuple(settings.native_size) == (0, 0)
    bpy.ops.playable.load_model()
    addon.close()
    assert tuple(settings.native_size) == (256, 144) and settings.steps_per_second == 5.0
    assert settings.licence == "Only to be tested"
    settings.model = "fake"
    assert tuple(settings.native_size) == (0, 0) and settings.licence == ""


def test_terms_are_said_when_an_environment_is_made_and_kept_in_the_file(scene, picture, capfd):
    opened(scene, picture, "turning")
    assert "weights: Only to be tested" in capfd.readouterr().out
    assert scene.playable_environment.licence == "Only to be tested"


def test_volumes_stand_where_the_model_draws_and_follow_their_empties(scene, picture):
    players = opened(scene, picture, "fake")
    boxes = volumes(scene)
    assert set(boxes) == {"ground", "player_1", "player_2"}
    np.testing.assert_allclose(corners(boxes["ground"]), (GROUND.low, GROUND.high), atol=1e-6)
    players["player_1"].location = (3.0, 4.0, 0.5)
    low, high = corners(boxes["player_1"])
    np.testing.assert_allclose(low, np.array(PLAYER.low) + (3.0, 4.0, 0.5), atol=1e-6)
    np.testing.assert_allclose(high, np.array(PLAYER.high) + (3.0, 4.0, 0.5), atol=1e-6)
    assert players["player_1"].empty_display_size == pytest.approx(PLAYER.high[2])
    assert all(each.hide_render and each.hide_select for each in boxes.values())


def test_a_second_picture_replaces_the_volumes(scene, picture):
    opened(scene, picture, "fake")
    only_one = json.dumps({"player_1": BOXES["player_1"]})
    bpy.ops.playable.new_environment(image=str(picture), model="fake", boxes=only_one)
    assert set(volumes(scene)) == {"ground", "player_1"}
    assert len([each for each in bpy.data.meshes if each.users]) == 2


def test_the_usual_camera_is_the_models_own_on_the_pictures_grid(scene, tmp_path):
    bpy.data.objects.remove(scene.camera)
    write_png(tmp_path / "square.png", picture_of(40, 40))
    box = json.dumps({"player_1": [18, 12, 22, 31]})
    bpy.ops.playable.new_environment(image=str(tmp_path / "square.png"), model="fake", boxes=box)
    assert (scene.render.resolution_x, scene.render.resolution_y) == (40, 40)
    bpy.context.view_layer.update()
    camera = read_camera(bpy.context.evaluated_depsgraph_get())
    expected = front_camera(40, 40)
    np.testing.assert_allclose(camera.intrinsics, expected.intrinsics, rtol=1e-6)
    np.testing.assert_allclose(camera.world_from_camera, expected.world_from_camera, atol=1e-6)


def test_the_usual_camera_stands_in_the_environment_wherever_that_is(scene, picture):
    players = opened(scene, picture, "fake", camera="USUAL")
    place = tuple(players["player_1"].location)
    root = scene.playable_environment.root
    root.location, root.rotation_euler, root.scale = (5, -3, 1), (0.1, 0, 2.0), (3, 3, 3)
    again = opened(scene, picture, "fake", camera="USUAL")["player_1"]
    assert tuple(again.location) == pytest.approx(place, abs=1e-6)
    moment = sample_range(scene, [1])[0]
    assert (moment.camera.width, moment.camera.height) == (WIDTH, HEIGHT)
    np.testing.assert_allclose(
        moment.camera.world_from_camera, front_camera().world_from_camera, atol=1e-6
    )
    assert moment.scale == pytest.approx(3.0)
    # The far corners of the ground are 27 metres away, three times as far in this scene.
    assert scene.camera.data.clip_end > 3 * 25


def test_a_picture_that_cannot_be_encoded_leaves_no_camera_behind(scene, picture):
    bpy.data.objects.remove(scene.camera)
    sky = json.dumps({"player_1": [10, -9, 20, -2]})
    with pytest.raises(RuntimeError, match="outside the picture"):
        bpy.ops.playable.new_environment(image=str(picture), model="fake", boxes=sky)
    assert scene.camera is None and not bpy.data.cameras.get("Environment Camera")


def test_passes_that_a_png_cannot_hold_are_not_asked_for(environment, monkeypatch, tmp_path):
    asked, render = [], Session.render
    monkeypatch.setattr(
        Session, "render", lambda self, shot, *rest: asked.append(shot) or render(self, shot, *rest)
    )
    environment.view_layers[0].use_pass_z = True
    bpy.ops.playable.bake_paths()
    bpy.ops.playable.render_to_sequencer(folder=str(tmp_path / "frames"))
    assert [shot.passes for shot in asked] == [()] * 4
    assert wanted_passes(environment, environment.view_layers[0]) == ("depth",)


def test_passes_are_kept_for_compositor_nodes(environment, tmp_path):
    if "compositing_node_group" in environment.bl_rna.properties:
        environment.compositing_node_group = bpy.data.node_groups.new("n", "CompositorNodeTree")
    else:
        environment.use_nodes = True
    environment.view_layers[0].use_pass_z = True
    with lent_settings(environment, job_for(environment, str(tmp_path))):
        assert wanted_passes(environment, environment.view_layers[0]) == ("depth",)


def test_a_model_named_relative_to_the_file_is_found(environment, picture, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "film.blend"))
    bpy.data.scenes[0].playable_environment.model = "//gone.safetensors"
    with pytest.raises(RuntimeError, match=f"no model '{tmp_path}/gone.safetensors'"):
        bpy.ops.playable.bake_paths()


def test_a_long_lens_survives_the_way_through_blenders_camera(scene):
    far = front_camera(512, 288)
    matrix = np.array([[1172.3, 0.0, 256.0], [0.0, 1172.3, 144.0], [0.0, 0.0, 1.0]])
    pose = far.world_from_camera.copy()
    pose[:3, 3] = 0.35, -38.9, 8.55
    look_through(scene.camera, scene.render, type(far)(512, 288, matrix, pose))
    bpy.context.view_layer.update()
    camera = read_camera(bpy.context.evaluated_depsgraph_get())
    np.testing.assert_allclose(camera.intrinsics, matrix, rtol=1e-6)
    np.testing.assert_allclose(camera.world_from_camera, pose, atol=1e-5)
