"""An imported Minecraft checkpoint in Blender: one class of players, who turn."""

import json
import sys

import numpy as np
import pytest
from addon.recorded_weights import imported_model
from addon.stage import opened_picture, read_png

from pe_runtime.contract.camera import project
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.images import read_image, write_png
from pe_runtime.interop.conventions import FOCAL_MULTIPLIERS, camera_from_theirs, focal_from_theirs

bpy = pytest.importorskip("bpy")
import blender_addon  # noqa: E402 - after the check for Blender
from blender_addon import playables  # noqa: E402
from blender_addon.bake import bake_of  # noqa: E402
from blender_addon.fcurves import curves_of  # noqa: E402
from blender_addon.scene_bridge import (  # noqa: E402
    action_names,
    look_through,
    playable_objects,
    sample_range,
)
from blender_addon.volumes import VOLUME_KEY  # noqa: E402
from blender_addon.worker.session import session  # noqa: E402
from blender_addon.worker.worker_client import worker_command  # noqa: E402

pytestmark = pytest.mark.blender

WIDTH, HEIGHT = 512, 288
ANGLES, PLACE, FOCAL = (-0.4224, 0.8593, 0.0267), (7.9469, 3.6033, 4.8187), 654.13
FEET = {"player_1": (1.3, -0.4, 0.0), "player_2": (-2.3, 1.0, 0.0)}
FRAMES = 5


def arena_camera():
    focal = focal_from_theirs(FOCAL, FOCAL_MULTIPLIERS["minecraft"])
    return camera_from_theirs(np.array(ANGLES), np.array(PLACE), focal, (WIDTH, HEIGHT), "y")


def boxes():
    """Boxes of players 1.8 m tall who stand at FEET."""
    found = {}
    for name, foot in FEET.items():
        ((x, bottom), (_, top)), _ = project(arena_camera(), np.array([foot, [*foot[:2], 1.8]]))
        found[name] = (x - 12.0, top, x + 12.0, bottom)
    return found


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return imported_model(tmp_path_factory.mktemp("minecraft"), "minecraft")


@pytest.fixture(scope="module")
def environment(model):
    """The same model without Blender or a worker in between."""
    return PlayableEnvironment.load(model, "cpu")


@pytest.fixture(scope="module")
def scene(model, environment):
    """The arena, opened and baked at one step of the model per frame."""
    picture = model.with_name("picture.png")
    noise = np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    write_png(picture, noise)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    blender_addon.register()
    session.use_command(worker_command(sys.executable))
    made = bpy.data.scenes[0]
    made.frame_start, made.frame_end = 1, FRAMES
    made.render.fps = round(environment.steps_per_second)
    holder = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    made.collection.objects.link(holder)
    made.camera = holder
    look_through(holder, made.render, arena_camera())
    try:
        bpy.ops.playable.new_environment(
            image=str(picture), model=str(model), boxes=json.dumps(boxes())
        )
        for index, each in enumerate(playable_objects(made).values()):
            playables.key_action(each, 1, 2 * index + 1)
        bpy.ops.playable.bake_paths()
        yield made
    finally:
        session.close()
        blender_addon.unregister()


@pytest.fixture(scope="module")
def states(scene, environment):
    """The model's own steps from the same picture, camera and boxes."""
    settings = scene.playable_environment
    shot, start = bake_of(settings).shot, opened_picture(scene)
    picture = read_image(start.image)
    found, memory = [environment.encode(picture, start.camera, start.boxes)], None
    for frame in range(1, FRAMES):
        actions = {name: shot.action_at(name, frame) for name in FEET}
        state, memory = environment.step(found[-1], actions, shot.camera_at(frame), memory)
        found.append(state)
    return found


def test_the_players_of_one_class_stand_in_the_arena_with_their_actions(scene, environment, states):
    scene.frame_set(1)
    for name, each in playable_objects(scene).items():
        assert tuple(each.location) == pytest.approx(FEET[name], abs=2e-3)
        assert tuple(action_names(each)) == environment.action_names[name]
        assert len(action_names(each)) == 7
    assert scene.playable_environment.steps_per_second == environment.steps_per_second
    drawn = {each[VOLUME_KEY] for each in scene.objects if VOLUME_KEY in each}
    assert drawn == {"arena", "player_1", "player_2"}


def test_the_empties_turn_as_the_model_predicts(scene, states):
    bake = bake_of(scene.playable_environment)
    moments = sample_range(scene, range(1, FRAMES + 1))
    for name, each in playable_objects(scene).items():
        expected = np.array([state[name].heading for state in states])
        np.testing.assert_array_equal(bake.headings[name], expected)
        assert abs(expected[0]) > 1e-3 and np.ptp(expected) > 1e-3
        keys = curves_of(each).find("rotation_euler", index=2).keyframe_points
        np.testing.assert_allclose([key.co[1] for key in keys], np.unwrap(expected), atol=1e-5)
        seen = np.array([moment.tracks[name].heading for moment in moments])
        np.testing.assert_allclose(np.cos(seen), np.cos(expected), atol=1e-5)
        np.testing.assert_allclose(np.sin(seen), np.sin(expected), atol=1e-5)


def still(scene, path, frame=2):
    scene.frame_set(frame)
    scene.render.image_settings.color_mode = "RGB"
    scene.render.resolution_percentage, scene.render.filepath = 25, str(path)
    bpy.ops.render.render(write_still=True, scene=scene.name)
    return read_png(path)


def test_a_player_turned_by_hand_is_drawn_turned(scene, tmp_path):
    before = still(scene, tmp_path / "before.png")
    target = playable_objects(scene)["player_1"]
    playables.remove_curves(target, "rotation_euler")
    target.rotation_euler.z += 1.5
    turned = still(scene, tmp_path / "turned.png")
    target.rotation_euler.z -= 1.5
    assert not np.array_equal(turned, before)
