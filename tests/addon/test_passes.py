"""Depth, masks, layers and the background are drawn where they are switched on, and only there."""

import dataclasses

import numpy as np
import pytest
from addon.stage import BOXES, HEIGHT, WIDTH, exr_channels, render_layers

bpy = pytest.importorskip("bpy")
from blender_addon import playables  # noqa: E402 - after the check for Blender
from blender_addon.bake import bake_of  # noqa: E402
from blender_addon.filming.pixels import FAR_AWAY, PassMemory  # noqa: E402
from blender_addon.filming.render_passes import blender_pass, layer_name, mask_name  # noqa: E402
from blender_addon.scene_bridge import inverse_of, playable_objects, wanted_passes  # noqa: E402
from blender_addon.strips.job import job_for  # noqa: E402
from blender_addon.strips.lending import lent_settings  # noqa: E402
from blender_addon.worker.session import Session  # noqa: E402

pytestmark = pytest.mark.blender


@pytest.fixture
def asked(environment, monkeypatch):
    """The passes of every frame that the worker is asked for."""
    bpy.ops.playable.bake_paths()
    passes, render = [], Session.render
    monkeypatch.setattr(
        Session,
        "render",
        lambda self, shot, *rest: passes.append(shot.passes) or render(self, shot, *rest),
    )
    return passes


def offered(scene):
    """The outputs that compositor nodes see of a view layer."""
    # Before 5.0 render layers are nodes of a scene's own tree only.
    own = not hasattr(scene, "compositing_node_group")
    if own:
        scene.use_nodes = True
    tree = scene.node_tree if own else bpy.data.node_groups.new("nodes", "CompositorNodeTree")
    node = tree.nodes.new("CompositorNodeRLayers")
    node.scene = scene
    scene.view_layers[0].update_render_passes()
    found = {socket.name for socket in node.outputs if socket.enabled}
    tree.nodes.remove(node)
    return found


def test_a_still_of_a_new_environment_asks_for_the_picture_alone(environment, asked):
    bpy.ops.render.render(scene=environment.name)
    assert asked == [()]
    assert bake_of(environment.playable_environment).shot.passes == ()


def test_depth_follows_the_view_layer_and_masks_follow_their_objects(environment, asked):
    players = playable_objects(environment)
    environment.view_layers[0].use_pass_z = True
    bpy.ops.render.render(scene=environment.name)
    players["player_2"].playable.use_mask = True
    bpy.ops.render.render(scene=environment.name)
    environment.view_layers[0].use_pass_z = False
    bpy.ops.render.render(scene=environment.name)
    assert asked == [("depth",), ("depth", "mask:player_2"), ("mask:player_2",)]


def test_layers_follow_their_objects_and_the_background_follows_the_scene(environment, asked):
    players = playable_objects(environment)
    players["player_1"].playable.use_layer = True
    bpy.ops.render.render(scene=environment.name)
    environment.playable_environment.use_background = True
    players["player_2"].playable.use_layer = players["player_2"].playable.use_mask = True
    bpy.ops.render.render(scene=environment.name)
    assert asked == [
        ("layer:player_1",),
        ("mask:player_2", "layer:player_1", "layer:player_2", "background"),
    ]


def test_each_view_layer_asks_for_its_own_depth(environment, asked):
    environment.view_layers.new("second").use_pass_z = True
    bpy.ops.render.render(scene=environment.name)
    assert sorted(asked) == [(), ("depth",)]


def test_each_view_layer_shows_its_own_picture_and_passes(environment, asked, tmp_path):
    first, second = environment.view_layers[0], environment.view_layers.new("Second")
    first.use_pass_z, second.use_pass_z = True, False
    playable_objects(environment)["player_2"].playable.use_mask = True
    hidden = bpy.data.collections.new("not in the second layer")
    environment.collection.children.link(hidden)
    player = playable_objects(environment)["player_1"]
    hidden.objects.link(player)
    environment.collection.objects.unlink(player)
    second.layer_collection.children[hidden.name].exclude = True
    bpy.ops.playable.bake_paths()
    path = render_layers(environment, tmp_path / "layers.exr")
    shown = [exr_channels(path, f"{layer.name}.") for layer in (first, second)]
    assert shown[0]["Depth.Z"].min() < FAR_AWAY and "Depth.Z" not in shown[1]
    assert shown[0]["Mask player_2.X"].any()
    assert np.array_equal(*(each["Mask player_2.X"] for each in shown))
    assert all((each["Combined.A"] == 1.0).all() for each in shown)
    assert not np.array_equal(*(each["Combined.R"] for each in shown))


def test_compositor_nodes_are_offered_what_is_switched_on(environment):
    assert "Depth" not in offered(environment)
    environment.view_layers[0].use_pass_z = True
    for each in playable_objects(environment).values():
        each.playable.use_mask = each.playable.use_layer = True
    environment.playable_environment.use_background = True
    of_objects = {f"{kind} {name}" for kind in ("Mask", "Layer") for name in BOXES}
    assert {"Depth", "Background", *of_objects} <= offered(environment)


def test_layers_and_the_background_arrive_in_a_multilayer_exr(environment, asked, addon, tmp_path):
    environment.playable_environment.use_background = True
    playable_objects(environment)["player_1"].playable.use_layer = True
    channels = exr_channels(render_layers(environment, tmp_path / "passes.exr"))
    passes = ("layer:player_1", "background")
    shot = dataclasses.replace(bake_of(environment.playable_environment).shot, passes=passes)
    drawn = addon.render(shot, 1)
    memory = PassMemory(WIDTH, HEIGHT)
    for name, numbers in (
        ("Layer player_1", memory.layer(drawn.layers["player_1"]).copy()),
        ("Background", memory.combined(drawn.background)),
    ):
        expected = numbers.reshape(HEIGHT, WIDTH, 4)[::-1]
        for index, channel in enumerate("RGBA"):
            assert np.array_equal(channels[f"{name}.{channel}"], expected[..., index])
    assert 0 < (channels["Layer player_1.A"] > 0).sum() < WIDTH * HEIGHT


def test_a_pass_with_a_long_name_is_found_by_the_name_that_blender_leaves_of_it():
    long = "Ä" * 60
    assert mask_name(long) == "Mask " + "Ä" * 29
    assert blender_pass(f"layer:{long}").name == layer_name(long) == "Layer " + "Ä" * 28


def test_switches_survive_saving_also_while_a_range_is_rendered(environment, tmp_path):
    playable_objects(environment)["player_1"].playable.use_mask = True
    environment.view_layers[0].use_pass_z = True
    file, switched_on = str(tmp_path / "film.blend"), ("depth", "mask:player_1")
    with lent_settings(environment, job_for(environment, str(tmp_path))):
        assert wanted_passes(environment, environment.view_layers[0]) == ()
        bpy.ops.wm.save_as_mainfile(filepath=file)
    assert wanted_passes(environment, environment.view_layers[0]) == switched_on
    bpy.ops.wm.open_mainfile(filepath=file)
    again = bpy.data.scenes[0]
    assert wanted_passes(again, again.view_layers[0]) == switched_on


def test_two_objects_of_one_name_stop_the_render_with_a_reason(environment, asked):
    playables.playable_objects(environment)["player_2"].playable.object_name = "player_1"
    with pytest.raises(RuntimeError, match="both stand for 'player_1'"):
        bpy.ops.render.render(scene=environment.name)
    assert asked == []


def test_the_inverse_of_a_root_undoes_it():
    random = np.random.default_rng(0)
    for scale in (1e-3, 1.0, 50.0):
        matrix = np.eye(4)
        matrix[:3, :3] = scale * np.linalg.qr(random.normal(size=(3, 3)))[0]
        matrix[:3] += 1e-5 * scale * random.normal(size=(3, 4))
        matrix[:3, 3] = random.normal(size=3) * 40
        np.testing.assert_allclose(inverse_of(matrix), np.linalg.inv(matrix), rtol=1e-9, atol=1e-9)
    assert np.array_equal(inverse_of(np.eye(4)), np.eye(4))
