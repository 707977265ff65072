"""The overlay of a scene: what its switches show, and what it costs to look again."""

import numpy as np
import pytest
from addon import stage

from blender_addon.overlay.scene_lines import AMBER, RED

bpy = pytest.importorskip("bpy")
pytestmark = pytest.mark.blender


def lines_of(scene):
    from blender_addon.overlay.viewport import overlay_lines

    bpy.context.view_layer.update()
    return overlay_lines(scene, scene.view_layers[0].depsgraph)


@pytest.fixture
def played(environment):
    """Player 1 walks left from frame 1 on; the paths are known."""
    from blender_addon.playables import key_action

    key_action(bpy.data.objects["player_1"], 1, 1)
    bpy.ops.playable.bake_paths()
    return environment


def only(scene, *names):
    overlay = scene.playable_environment.overlay
    for name in overlay.bl_rna.properties.keys():
        if overlay.bl_rna.properties[name].type == "BOOLEAN":
            setattr(overlay, name, name in names)


def test_an_empty_scene_has_nothing_to_show(addon):
    lines = lines_of(bpy.data.scenes[0])
    assert lines.segments == 0 and not lines.labels and not lines.dots


@pytest.fixture
def framed(addon, picture):
    """A picture with the usual camera and two boxes, before it is encoded."""
    scene = bpy.data.scenes[0]
    settings = scene.playable_environment
    settings.model, settings.image_path = "fake", str(picture)
    bpy.ops.playable.load_model()
    bpy.ops.playable.show_picture()
    settings.set_boxes(stage.BOXES, stage.BOXES)
    return scene


def test_boxes_grid_and_volumes_are_shown_on_the_picture_before_it_is_encoded(framed):
    for name, segments in (("boxes", 8), ("volumes", 24)):
        only(framed, name)
        assert lines_of(framed).segments == segments
    only(framed, "grid")
    assert lines_of(framed).segments > 8
    only(framed, "boxes")
    texts = {each.text for each in lines_of(framed).labels}
    assert texts == set(stage.BOXES)


def test_a_box_in_the_sky_is_red_and_says_why(framed):
    framed.playable_environment.framing.camera_mode = "SCENE"
    framed.camera.rotation_euler.x += 0.3
    framed.playable_environment.boxes["player_1"].box = (12.0, 1.0, 20.0, 4.0)
    only(framed, "boxes")
    lines = lines_of(framed)
    assert RED in [tuple(each.colours[0]) for each in lines.strokes]
    assert any("horizon" in each.text for each in lines.labels)
    assert max(len(line) for each in lines.labels for line in each.text.split("\n")) < 50


def test_a_player_far_away_is_amber(framed):
    framed.playable_environment.boxes["player_1"].box = (12.0, 4.0, 20.0, 9.0)
    only(framed, "boxes")
    assert AMBER in [tuple(each.colours[0]) for each in lines_of(framed).strokes]


def test_ground_points_are_shown_although_the_camera_is_not_matched_yet(framed):
    framing = framed.playable_environment.framing
    framing.camera_mode = "MATCH"
    point = framing.add_point()
    point.pixel, point.is_placed = (20.0, 20.0), True
    only(framed, "points", "grid")
    lines = lines_of(framed)
    assert lines.segments == 2 and [each.text for each in lines.labels] == ["Point 1"]
    framing.camera_mode = "USUAL"
    only(framed, "points")
    assert lines_of(framed).segments == 0


def test_the_picture_is_looked_at_anew_only_when_something_has_changed(framed):
    from blender_addon.overlay.scene_views import picture_view_of

    depsgraph = framed.view_layers[0].depsgraph
    first = picture_view_of(framed, depsgraph)
    assert picture_view_of(framed, depsgraph) is first
    framed.playable_environment.boxes["player_1"].box = (13.0, 10.0, 20.0, 30.0)
    assert picture_view_of(framed, depsgraph) is not first


def test_once_encoded_the_picture_is_left_alone(framed):
    bpy.ops.playable.open_picture()
    assert lines_of(framed).segments == 0


def test_paths_run_through_the_baked_positions(played):
    from blender_addon.bake import bake_of

    only(played, "paths")
    lines = lines_of(played)
    paths = bake_of(played.playable_environment).paths
    assert len(lines.strokes) == len(paths) == 2
    for stroke, path in zip(lines.strokes, paths.values(), strict=True):
        assert np.allclose(stroke.ends[:, 0], path[:-1])


def test_the_action_that_was_keyed_is_named_on_the_path(played):
    only(played, "actions")
    assert "Left" in [each.text for each in lines_of(played).labels]


def test_ghosts_are_boxes_of_the_models_volumes(played):
    from blender_addon.volumes import volumes_in

    overlay = played.playable_environment.overlay
    only(played, "ghosts")
    overlay.ghosts_before, overlay.ghosts_after, overlay.ghost_steps = 0, 1, 1
    lines = lines_of(played)
    # Player 2 stands idle: it would be its own ghost.
    assert [len(each.ends) for each in lines.strokes] == [12]
    size = np.ptp(lines.strokes[0].ends.reshape(-1, 3), axis=0)
    volume = volumes_in(played)["player_1"]
    assert np.allclose(size, np.subtract(volume.high, volume.low), atol=1e-6)


def test_a_player_that_the_artist_moves_off_its_path_is_shown_where_its_keys_put_it(played):
    only(played, "paths")
    before = lines_of(played).strokes[0].ends.copy()
    player = bpy.data.objects["player_1"]
    played.frame_set(3)
    player.location.y += 2.0
    player.keyframe_insert("location", frame=3)
    after = lines_of(played).strokes[0].ends
    moved = np.abs(after - before).max(axis=2)
    assert moved[1, 1] == pytest.approx(2.0, abs=1e-5) and moved[0, 0] == 0.0


def test_once_encoded_nothing_hides_the_preview(environment):
    shown = environment.camera.data.background_images
    assert len(shown) == 1 and not shown[0].show_background_image


@pytest.mark.parametrize("name", ["players", "paths", "steps", "actions", "ghosts"])
def test_every_switch_takes_its_lines_away(played, name):
    only(played, name)
    played.playable_environment.overlay.ghost_steps = 1
    on = lines_of(played)
    assert on.segments or on.dots or on.labels
    only(played)
    off = lines_of(played)
    assert not (off.segments or off.dots or off.labels)


def test_looking_again_at_an_unchanged_scene_computes_nothing_anew(played):
    from blender_addon.overlay.scene_views import foresight_of

    first = foresight_of(played)
    assert foresight_of(played) is first
    played.frame_set(3)
    assert foresight_of(played) is not first


def test_two_objects_that_claim_one_name_do_not_break_the_viewport(played):
    lines_of(played)
    twin = bpy.data.objects["player_1"].copy()
    played.collection.objects.link(twin)
    played.frame_set(2)
    lines_of(played)


def test_the_overlay_has_a_panel_in_the_tab(addon):
    panel = bpy.types.PLAYABLE_PT_overlay
    assert panel.bl_category == "Playable" and "DEFAULT_CLOSED" in panel.bl_options
