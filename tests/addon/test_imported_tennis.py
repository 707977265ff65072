"""An imported tennis checkpoint in Blender: scene, keys, render, strip, and all of it again.

The weights are the recorded ones where they are at hand. One journey through the add-on, with a
real worker, leaves what it saw; the tests look at that.
"""

import json
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 its own documentation's name
import pytest
from addon.recorded_weights import imported_model
from addon.stage import opened_picture, read_png

from pe_runtime.contract.camera import Camera
from pe_runtime.environment import PlayableEnvironment, RenderOptions
from pe_runtime.images import read_image, to_uint8, write_png
from pe_runtime.interop.conventions import (
    FOCAL_MULTIPLIERS,
    camera_from_theirs,
    focal_from_theirs,
)

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
from blender_addon.settings import action_items  # noqa: E402
from blender_addon.strips.timing import span  # noqa: E402
from blender_addon.volumes import VOLUME_KEY  # noqa: E402
from blender_addon.worker.session import session  # noqa: E402
from blender_addon.worker.worker_client import worker_command  # noqa: E402

pytestmark = pytest.mark.blender

WIDTH, HEIGHT = 512, 288
# A frame of a broadcast: who took it from where, and both players in it.
ANGLES, PLACE, FOCAL = (1.3743, 0.021, -0.013), (0.35, -38.9, 8.55), 2280.0
BOXES = {"player_1": (168.96, 178.56, 209.92, 247.68), "player_2": (286.72, 60.48, 307.2, 95.04)}
FEET = {"player_1": (-1.5989, -9.4709, 0.01), "player_2": (2.1225, 15.4923, 0.01)}
KEYS = {"player_1": ((1, 4), (3, 2)), "player_2": ((1, 1), (5, 6))}
FRAMES, FPS = 6, 10
PERCENT = 25


@dataclass
class Journey:
    """What was seen on the way."""

    model: Path
    picture: Path
    folder: Path
    empties: dict = field(default_factory=dict)
    volumes: dict = field(default_factory=dict)
    facts: dict = field(default_factory=dict)
    encoded: object = None
    bake: object = None
    keyed: dict = field(default_factory=dict)
    still: np.ndarray | None = None
    strip: dict = field(default_factory=dict)
    again: dict = field(default_factory=dict)


def broadcast_camera():
    focal = focal_from_theirs(FOCAL, FOCAL_MULTIPLIERS["tennis"])
    return camera_from_theirs(np.array(ANGLES), np.array(PLACE), focal, (WIDTH, HEIGHT), "z")


@pytest.fixture(scope="module")
def journey(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tennis")
    made = Journey(imported_model(folder, "tennis"), folder / "picture.png", folder)
    noise = np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    write_png(made.picture, noise)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    blender_addon.register()
    session.use_command(worker_command(sys.executable))
    try:
        open_scene(made)
        key_and_bake(made)
        film(made)
        reopen(made)
        yield made
    finally:
        session.close()
        blender_addon.unregister()


def open_scene(made):
    scene = bpy.data.scenes[0]
    scene.frame_start, scene.frame_end, scene.render.fps = 1, FRAMES, FPS
    holder = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(holder)
    scene.camera = holder
    look_through(holder, scene.render, broadcast_camera())
    bpy.ops.playable.new_environment(
        image=str(made.picture), model=str(made.model), boxes=json.dumps(BOXES)
    )
    for name, each in playable_objects(scene).items():
        items = action_items(each.playable.action_names)
        made.empties[name] = {
            "type": each.type,
            "name": each.name,
            "location": tuple(each.location),
            "turn": each.rotation_euler.z,
            "actions": action_names(each),
            "labels": [item[1] for item in items[:7]],
        }
    bpy.context.view_layer.update()
    for each in scene.objects:
        if VOLUME_KEY in each:
            points = np.array([each.matrix_world @ v.co for v in each.data.vertices])
            made.volumes[each[VOLUME_KEY]] = points.min(axis=0), points.max(axis=0)
    settings = scene.playable_environment
    made.encoded = opened_picture(scene)
    made.facts = {
        "size": tuple(settings.native_size),
        "pace": settings.steps_per_second,
        "licence": settings.licence,
    }


def key_and_bake(made):
    scene = bpy.data.scenes[0]
    objects = playable_objects(scene)
    for name, keys in KEYS.items():
        for frame, action in keys:
            playables.key_action(objects[name], frame, action)
    camera = scene.camera
    for frame, x in ((1, camera.location.x), (FRAMES, camera.location.x + 2.0)):
        camera.location.x = x
        camera.keyframe_insert("location", frame=frame)
    bpy.ops.playable.bake_paths()
    made.bake = bake_of(scene.playable_environment)
    for name, each in objects.items():
        moments = sample_range(scene, range(1, FRAMES + 1))
        made.keyed[name] = np.array([moment.tracks[name].location for moment in moments])
        assert curves_of(each).find("rotation_euler", index=2) is None


def film(made):
    scene = bpy.data.scenes[0]
    settings = scene.playable_environment
    scene.render.image_settings.color_mode = "RGB"
    made.still = still(scene, made.folder / "full.png", 3)
    scene.view_layers[0].use_pass_z = True
    for each in playable_objects(scene).values():
        each.playable.use_mask = True
    scene.render.resolution_percentage = PERCENT
    bpy.ops.playable.render_to_sequencer(folder=str(made.folder / "frames"))
    (strip,) = settings.edit_scene.sequence_editor.strips
    made.strip = {
        "files": [each.filename for each in strip.elements],
        "span": span(strip),
        "directory": strip.directory,
        "rates": (settings.edit_scene.render.fps, settings.edit_scene.frame_end),
    }
    passes(scene, made.folder / "passes.exr")


def still(scene, path, frame):
    scene.frame_set(frame)
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True, scene=scene.name)
    return read_png(path)


def passes(scene, path):
    """One frame of an eighth of the size with all that the engine can give."""
    output, percent = scene.render.image_settings, scene.render.resolution_percentage
    scene.render.resolution_percentage = PERCENT // 2
    if hasattr(output, "media_type"):
        output.media_type = "MULTI_LAYER_IMAGE"
    output.file_format, output.color_depth = "OPEN_EXR_MULTILAYER", "32"
    scene.frame_set(1)
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True, scene=scene.name)
    if hasattr(output, "media_type"):
        output.media_type = "IMAGE"
    output.file_format, output.color_mode = "PNG", "RGB"
    scene.render.resolution_percentage = percent


def reopen(made):
    file = str(made.folder / "film.blend")
    bpy.ops.wm.save_as_mainfile(filepath=file)
    session.close()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=file)
    scene = next(each for each in bpy.data.scenes if each.playable_environment.root)
    made.again = {
        "digest": bake_of(scene.playable_environment).shot.digest(),
        "licence": scene.playable_environment.licence,
        "frames": {frame: still(scene, made.folder / "again.png", frame) for frame in (2, FRAMES)},
    }


@pytest.fixture(scope="module")
def environment(journey):
    """The same model without Blender or a worker in between."""
    return PlayableEnvironment.load(journey.model, "cpu")


@pytest.fixture(scope="module")
def start(journey, environment):
    picture = journey.encoded
    return environment.encode(read_image(journey.picture), picture.camera, picture.boxes)


def test_both_players_become_empties_where_they_stand_on_the_court(journey):
    assert list(journey.empties) == list(BOXES)
    for name, each in journey.empties.items():
        assert (each["type"], each["name"], each["turn"]) == ("EMPTY", name, 0.0)
        assert each["location"] == pytest.approx(FEET[name], abs=2e-3)


def test_each_player_offers_the_seven_actions_of_its_own_class(journey, environment):
    for name, each in journey.empties.items():
        assert tuple(each["actions"]) == environment.action_names[name]
        assert len(set(each["actions"])) == len(each["labels"]) == 7
        assert each["labels"] == [action.capitalize() for action in each["actions"]]


def test_the_court_stands_in_the_viewport_at_its_size(journey):
    assert set(journey.volumes) == {"court", "backplate", "player_1", "player_2"}
    low, high = journey.volumes["court"]
    np.testing.assert_allclose((low, high), ((-30, -40, -0.5), (30, 20.585, 0)), atol=1e-4)
    low, high = journey.volumes["backplate"]
    np.testing.assert_allclose((low, high), ((-30, 20.085, 0), (30, 20.585, 30)), atol=1e-4)
    low, high = journey.volumes["player_2"]
    np.testing.assert_allclose(high - low, (1.5, 1.0, 2.15), atol=1e-4)
    np.testing.assert_allclose((low + high)[:2] / 2, FEET["player_2"][:2], atol=2e-3)


def test_the_panel_knows_size_pace_and_terms(journey):
    assert (journey.facts["size"], journey.facts["pace"]) == ((WIDTH, HEIGHT), 5.0)
    assert "CC BY-NC 4.0" in journey.facts["licence"] == journey.again["licence"]


def test_baked_paths_are_the_models_own_steps_under_the_keys(journey, environment, start):
    shot, state, memory = journey.bake.shot, start, None
    for step in range(FRAMES // 2):
        frame = 1 + 2 * step
        for name in BOXES:
            expected = state[name].position.double().numpy()
            np.testing.assert_array_equal(journey.bake.paths[name][frame - 1], expected)
        actions = {name: shot.action_at(name, frame) for name in BOXES}
        state, memory = environment.step(state, actions, shot.camera_at(frame), memory)
    moved = [np.ptp(path, axis=0).max() for path in journey.bake.paths.values()]
    assert min(moved) > 1e-3 and journey.bake.headings == {}


def test_the_empties_walk_the_baked_paths(journey):
    for name, path in journey.bake.paths.items():
        np.testing.assert_allclose(journey.keyed[name], path, atol=1e-5)


def test_a_frame_of_full_size_holds_the_models_own_pixels(journey, environment, start):
    shot = journey.bake.shot
    actions = {name: shot.action_at(name, 1) for name in BOXES}
    state, _ = environment.step(start, actions, shot.camera_at(1))
    drawn = to_uint8(environment.render(state, shot.camera_at(3), RenderOptions()).rgb)
    assert journey.still.shape == (HEIGHT, WIDTH, 3)
    assert np.array_equal(journey.still, drawn)


def test_the_strip_shows_every_frame_once_in_order(journey):
    names = [f"frame_{frame:04d}.png" for frame in range(1, FRAMES + 1)]
    assert journey.strip["files"] == names
    assert journey.strip["span"] == (1, FRAMES)
    assert journey.strip["rates"] == (FPS, FRAMES)
    assert Path(journey.strip["directory"]).resolve() == journey.folder / "frames"
    frames = [read_png(journey.folder / "frames" / name) for name in names]
    assert {frame.shape for frame in frames} == {(72, 128, 3)}
    assert len({frame.tobytes() for frame in frames}) == FRAMES


def test_depth_and_masks_of_the_court_arrive_in_an_exr(journey):
    source, found, part = oiio.ImageInput.open(str(journey.folder / "passes.exr")), {}, 0
    while source.seek_subimage(part, 0):
        pixels = source.read_image(part, 0, 0, source.spec().nchannels, oiio.FLOAT)
        for index, name in enumerate(source.spec().channelnames):
            found[".".join(name.split(".")[-2:])] = pixels[..., index]
        part += 1
    source.close()
    depth = found["Depth.Z"]
    assert depth.shape == (34, 61)
    # The court begins before the camera and ends at the backplate, 20 m behind the net.
    near = depth[depth < 1e9]
    assert near.size > depth.size / 4 and near.min() >= 5.0 and near.max() < 65.0
    assert {f"Mask {name}.X" for name in BOXES} <= set(found)


def test_the_saved_file_renders_the_same_pixels_again(journey):
    assert journey.again["digest"] == journey.bake.shot.digest()
    for frame, pixels in journey.again["frames"].items():
        before = read_png(journey.folder / "frames" / f"frame_{frame:04d}.png")
        assert np.array_equal(pixels, before)


def test_the_broadcast_camera_is_the_one_that_blender_films_with(journey):
    first: Camera = journey.bake.shot.cameras[0]
    np.testing.assert_allclose(first.intrinsics, broadcast_camera().intrinsics, rtol=1e-6)
    np.testing.assert_allclose(
        first.world_from_camera, broadcast_camera().world_from_camera, atol=1e-5
    )
