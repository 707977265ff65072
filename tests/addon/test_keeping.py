"""An environment lives in its file: older versions', moved, linked, renamed, and without us."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from addon import stage
from addon.stage import read_png

bpy = pytest.importorskip("bpy")
pytestmark = pytest.mark.blender

import blender_addon  # noqa: E402
from blender_addon import playables  # noqa: E402
from blender_addon.bake import bake_of  # noqa: E402
from blender_addon.fcurves import curves_of  # noqa: E402
from blender_addon.keeping.migration import migrate  # noqa: E402
from blender_addon.keeping.panels import PLAYABLE_PT_problems  # noqa: E402
from blender_addon.keeping.problems import problems_of  # noqa: E402
from blender_addon.scene_bridge import playable_objects, sample_range  # noqa: E402
from blender_addon.settings import SCHEMA  # noqa: E402

FILES = Path(__file__).with_name("files")
OLD, OLD_FRAME = FILES / "schema_1.blend", FILES / "schema_1_frame_0004.png"


@pytest.fixture
def baked(environment):
    playables.key_action(playable_objects(environment)["player_1"], 1, 1)
    bpy.ops.playable.bake_paths()
    return environment


def saved(path):
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def opened(path):
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return bpy.data.scenes[0]


def film(scene, frame, path):
    """What the engine saves for a frame, (height, width, 3) uint8.

    As a range of one: a still of a scene that is not the active one shows the active one's frame.
    """
    kept = scene.frame_start, scene.frame_end
    scene.frame_start = scene.frame_end = frame
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath, scene.render.use_file_extension = f"{path}_####", True
    bpy.ops.render.render(animation=True, scene=scene.name)
    scene.frame_start, scene.frame_end = kept
    return read_png(f"{path}_{frame:04d}.png")


def old_file(folder):
    return Path(shutil.copy(OLD, folder / "old.blend"))


def test_a_file_of_the_first_version_renders_its_old_pixels_though_its_picture_is_gone(
    addon, tmp_path
):
    scene = opened(old_file(tmp_path))
    assert scene.playable_environment.schema == SCHEMA
    drawn = film(scene, 4, tmp_path / "now.png")
    assert np.array_equal(drawn, read_png(OLD_FRAME))


def test_migrating_keeps_keys_and_paths_and_makes_the_bake_start_from_its_state(addon, tmp_path):
    scene = opened(old_file(tmp_path))
    players = playable_objects(scene)
    actions = [moment.tracks["player_1"].action for moment in sample_range(scene, range(1, 9))]
    assert actions == [1, 1, 1, 1, 3, 3, 3, 3]
    assert {curve.data_path for curve in curves_of(players["player_1"])} == {
        "playable.action",
        "location",
    }
    stored = json.loads(scene.playable_environment.bake_text.as_string())
    assert stored["shot"]["start"]["image"] is None
    # What is stored can be changed in a library override of the file.
    assert players["player_1"].playable.is_property_set("overrides")
    assert migrate(scene) == ""


def test_a_migrated_file_saves_and_opens_as_it_was(addon, tmp_path):
    scene = opened(old_file(tmp_path))
    first = film(scene, 7, tmp_path / "first.png")
    again = opened(saved(tmp_path / "new.blend"))
    assert np.array_equal(film(again, 7, tmp_path / "second.png"), first)


def test_a_scene_of_a_newer_version_is_left_alone_and_says_so(baked):
    baked.playable_environment.schema = SCHEMA + 1
    assert "newer version" in migrate(baked)
    assert baked.playable_environment.schema == SCHEMA + 1
    (problem,) = problems_of(baked)
    assert "update the add-on" in problem
    with pytest.raises(RuntimeError, match="update the add-on"):
        bpy.ops.playable.bake_paths()
    with pytest.raises(RuntimeError, match="update the add-on"):
        bpy.ops.render.render()


def test_a_damaged_bake_survives_migration_for_whoever_wants_to_look(addon, tmp_path):
    scene = opened(old_file(tmp_path))
    scene.playable_environment.schema = 1
    scene.playable_environment.bake_text.from_string("{damaged")
    migrate(scene)
    assert scene.playable_environment.bake_text.as_string() == "{damaged"
    assert any("is no bake" in problem for problem in problems_of(scene))


WITHOUT_US = """
import bpy, sys
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
assert not hasattr(bpy.types.Scene, "playable_environment")
bpy.data.objects["player_1"].scale = 2, 2, 2
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[2])
"""


def test_a_file_saved_by_a_blender_without_the_addon_comes_back_whole(baked, addon, tmp_path):
    before = film(baked, 3, tmp_path / "before.png")
    source = saved(tmp_path / "ours.blend")
    foreign = str(tmp_path / "theirs.blend")
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_US, str(source), foreign], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    scene = opened(foreign)
    assert playable_objects(scene)["player_1"].playable.object_name == "player_1"
    assert np.array_equal(film(scene, 3, tmp_path / "after.png"), before)


def test_renaming_an_empty_changes_nothing(baked, tmp_path):
    before = film(baked, 3, tmp_path / "before.png")
    player = playable_objects(baked)["player_1"]
    player.name = "Serena in the red shirt"
    baked.playable_environment.root.name = "Court"
    baked.name = "Final"
    assert np.array_equal(film(baked, 3, tmp_path / "after.png"), before)
    playables.key_action(player, 2, 3)
    bpy.ops.playable.bake_paths()
    assert problems_of(baked) == []


def test_a_duplicate_is_named_as_a_second_claim(baked):
    player = playable_objects(baked)["player_1"]
    double = player.copy()
    baked.collection.objects.link(double)
    (problem,) = [text for text in problems_of(baked) if "both stand for" in text]
    assert "player_1" in problem
    with pytest.raises(RuntimeError, match="both stand for"):
        bpy.ops.playable.bake_paths()
    bpy.data.objects.remove(double)
    assert problems_of(baked) == []


def test_a_deleted_empty_is_missed_by_name(baked):
    bpy.data.objects.remove(playable_objects(baked)["player_2"])
    assert any("'player_2' is in the picture but has no Empty" in p for p in problems_of(baked))


def test_missing_models_and_pictures_are_named_before_anyone_renders(baked, picture):
    assert problems_of(baked) == []
    picture.unlink()
    (problem,) = problems_of(baked)
    assert "rendering goes on" in problem
    baked.playable_environment.model = "//gone/court.safetensors"
    assert any("model file //gone/court.safetensors is missing" in p for p in problems_of(baked))


def test_frames_that_left_the_strips_folder_are_counted(baked, tmp_path):
    bpy.ops.playable.render_to_sequencer(folder=str(tmp_path / "frames"))
    assert problems_of(baked) == []
    (tmp_path / "frames" / "frame_0002.png").unlink()
    (problem,) = problems_of(baked)
    assert problem.startswith("1 of 4 frames of the strip")


def test_frames_are_missed_in_whatever_scene_and_place_the_strip_is(baked, tmp_path):
    cut = bpy.data.scenes.new("The cut")
    baked.playable_environment.strips.target = cut
    bpy.ops.playable.render_to_sequencer(folder=str(tmp_path / "frames"))
    assert baked.playable_environment.edit_scene is None and problems_of(baked) == []
    (tmp_path / "frames" / "frame_0003.png").unlink()
    assert [text.partition(" frames")[0] for text in problems_of(baked)] == ["1 of 4"]


def test_a_strip_made_before_the_first_save_is_relative_afterwards(baked, tmp_path):
    bpy.ops.playable.render_to_sequencer(folder=str(tmp_path / "film" / "frames"))
    saved(tmp_path / "film" / "film.blend")
    edit = baked.playable_environment.edit_scene
    (strip,) = edit.sequence_editor.strips
    assert strip.directory.startswith("//frames")
    shutil.move(tmp_path / "film", tmp_path / "moved")
    scene = opened(tmp_path / "moved" / "film.blend")
    assert problems_of(scene) == []


def test_two_environments_of_one_file_do_not_know_each_other(baked, picture, tmp_path):
    other = bpy.data.scenes.new("Other")
    other.frame_start, other.frame_end, other.render.fps = 1, 4, 10
    other.camera = baked.camera
    for name in ("resolution_x", "resolution_y"):
        setattr(other.render, name, getattr(baked.render, name))
    with bpy.context.temp_override(scene=other, view_layer=other.view_layers[0]):
        boxes = json.dumps(stage.BOXES)
        bpy.ops.playable.new_environment(image=str(picture), model="fake", boxes=boxes)
        playables.key_action(playable_objects(other)["player_1"], 1, 2)
        bpy.ops.playable.bake_paths()
    assert other.playable_environment.root != baked.playable_environment.root
    one, two = bake_of(baked.playable_environment), bake_of(other.playable_environment)
    assert not np.allclose(one.paths["player_1"][-1], two.paths["player_1"][-1])
    first = film(baked, 4, tmp_path / "one.png")
    assert not np.array_equal(first, film(other, 4, tmp_path / "two.png"))
    assert np.array_equal(first, film(baked, 4, tmp_path / "three.png"))
    assert problems_of(baked) == problems_of(other) == []


def test_an_appended_scene_brings_its_whole_environment(baked, addon, tmp_path):
    before = film(baked, 4, tmp_path / "before.png")
    source, name = saved(tmp_path / "source.blend"), baked.name
    bpy.ops.wm.read_factory_settings(use_empty=True)
    # Factory settings switch add-ons off.
    blender_addon.unregister()
    blender_addon.register()
    addon.use_command(stage.FAKE)
    with bpy.data.libraries.load(str(source)) as (_, taken):
        taken.scenes = [name]
    (scene,) = taken.scenes
    assert np.array_equal(film(scene, 4, tmp_path / "after.png"), before)


def test_a_linked_scene_renders_and_cannot_be_keyed(baked, addon, tmp_path):
    before = film(baked, 4, tmp_path / "before.png")
    source, name = saved(tmp_path / "source.blend"), baked.name
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.name = "own"  # Blender renders a scene by its name
    with bpy.data.libraries.load(str(source), link=True) as (_, taken):
        taken.scenes = [name]
    (scene,) = taken.scenes
    assert not scene.is_editable and migrate(scene) == ""
    bpy.context.scene.render.engine = "BLENDER_WORKBENCH"
    with pytest.raises(blender_addon.playables.ShotError, match="library override"):
        playables.key_action(playable_objects(scene)["player_1"], 2, 2)
    assert np.array_equal(film(scene, 4, tmp_path / "after"), before)


def test_a_library_override_is_keyed_locally_and_keeps_its_keys_in_the_file(baked, tmp_path):
    source = saved(tmp_path / "source.blend")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(source), link=True) as (_, taken):
        taken.objects = ["player_1"]
    (linked,) = taken.objects
    local = linked.override_create()
    bpy.context.scene.collection.objects.link(local)
    playables.key_action(local, 9, 3)
    saved(tmp_path / "user.blend")
    opened(tmp_path / "user.blend")
    local = next(each for each in bpy.data.objects if each.override_library)
    frames = [
        key.co.x
        for curve in curves_of(local)
        if curve.data_path == playables.ACTION_PATH
        for key in curve.keyframe_points
    ]
    assert 9.0 in frames and local.playable.object_name == "player_1"


def test_what_needs_attention_stands_above_panels_that_the_artist_has_moved():
    # Blender keeps panels with headers in the artist's order, new ones below.
    assert "HIDE_HEADER" in PLAYABLE_PT_problems.bl_options


def test_a_library_override_keeps_its_passes_its_action_and_whom_it_stands_for(scene, tmp_path):
    for name in ("one", "two"):
        each = bpy.data.objects.new(name, None)
        scene.collection.objects.link(each)
        each.playable.is_playable, each.playable.object_name = True, name
        each.playable.action_names = '["idle", "left", "right"]'
    source = saved(tmp_path / "source.blend")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(source), link=True) as (_, taken):
        taken.objects = ["one", "two"]
    first, second = (each.override_create() for each in taken.objects)
    for local in (first, second):
        bpy.context.scene.collection.objects.link(local)
    first.playable.use_mask = first.playable.use_layer = True
    first.playable.action, first.playable.object_name = "A2", "three"
    second.playable.is_playable = False
    saved(tmp_path / "user.blend")
    opened(tmp_path / "user.blend")
    own = {each.name: each.playable for each in bpy.data.objects if each.override_library}
    found = own["one"]
    assert (found.use_mask, found.use_layer, found.action) == (True, True, "A2")
    assert (found.object_name, own["two"].object_name) == ("three", "two")
    assert (found.is_playable, own["two"].is_playable) == (True, False)
