"""Rendered ranges as strips: one per job, replaced in place, never in the engine's way."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from addon.stage import faulty, read_png

bpy = pytest.importorskip("bpy")
from blender_addon import playables  # noqa: E402 - after the check for Blender
from blender_addon.scene_bridge import playable_objects  # noqa: E402
from blender_addon.strips.job import job_for  # noqa: E402
from blender_addon.strips.lending import lent_settings  # noqa: E402
from blender_addon.strips.operators import show_where_none_is_chosen  # noqa: E402
from blender_addon.strips.placing import StripPlan, place_strip  # noqa: E402
from blender_addon.strips.provenance import JOB_KEY  # noqa: E402
from blender_addon.strips.timing import span  # noqa: E402
from blender_addon.strips.video import write_video  # noqa: E402
from pe_runtime.contract.errors import ShotError  # noqa: E402

pytestmark = pytest.mark.blender


@pytest.fixture
def baked(environment):
    playables.key_action(playable_objects(environment)["player_1"], 1, 1)
    bpy.ops.playable.bake_paths()
    return environment


@pytest.fixture
def edit():
    """A scene with an empty sequencer that never asks a 3D engine."""
    made = bpy.data.scenes.new("cut")
    made.sequence_editor_create()
    made.render.engine = "BLENDER_WORKBENCH"
    yield made
    bpy.ops.wm.read_factory_settings(use_empty=True)


def strips_of(scene):
    return list(scene.playable_environment.edit_scene.sequence_editor.strips)


def cut_frame(edit, frame, path):
    """One frame of the sequencer's picture, as bytes.

    A still of a scene that is not the active one shows the active scene's frame (Blender 5.0).
    """
    edit.frame_start = edit.frame_end = frame
    edit.render.image_settings.color_mode = "RGB"
    edit.render.use_file_extension, edit.render.filepath = False, str(path)
    bpy.ops.render.render(animation=True, scene=edit.name)
    return read_png(f"{path}{frame:04d}")


def numbered_files(folder, count, name="a"):
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{name}_{number}.png" for number in range(count)]
    for file in files:
        file.write_bytes(b"")
    return files


def test_the_range_becomes_files_and_one_strip_in_the_edit_scene(baked, tmp_path):
    baked.render.filepath = "//untouched"
    bpy.ops.playable.render_to_sequencer(folder=str(tmp_path / "frames"))
    files = sorted((tmp_path / "frames").glob("*.png"))
    assert [file.name for file in files] == [f"frame_{n:04d}.png" for n in range(1, 5)]
    (strip,) = strips_of(baked)
    assert [element.filename for element in strip.elements] == [file.name for file in files]
    assert span(strip) == (1, 4)
    assert strip.colorspace_settings.name == "sRGB"
    edit = baked.playable_environment.edit_scene
    assert edit != baked and edit.name == f"{baked.name} Edit"
    assert (edit.render.fps, edit.frame_end) == (10, 4)
    assert edit.view_settings.view_transform == "Standard"
    assert baked.sequence_editor is None or not len(baked.sequence_editor.strips)
    assert baked.render.filepath == "//untouched" and baked.render.use_sequencer


def test_the_strip_shows_the_very_bytes_of_the_files(baked, tmp_path):
    bpy.ops.playable.render_to_sequencer(folder=str(tmp_path / "frames"))
    cut = cut_frame(baked.playable_environment.edit_scene, 3, tmp_path / "cut.png")
    assert np.array_equal(cut, read_png(tmp_path / "frames" / "frame_0003.png"))


def test_repeating_replaces_the_strip_in_place_and_shows_the_new_pixels(baked, tmp_path):
    folder = str(tmp_path / "frames")
    bpy.ops.playable.render_to_sequencer(folder=folder)
    (strip,) = strips_of(baked)
    strip.name, strip.channel = "renamed by the artist", 7
    edit = baked.playable_environment.edit_scene
    first = cut_frame(edit, 4, tmp_path / "first.png")
    playables.key_action(playable_objects(baked)["player_1"], 1, 2)
    baked.frame_end = 5
    bpy.ops.playable.bake_paths()
    bpy.ops.playable.render_to_sequencer(folder=folder)
    (again,) = strips_of(baked)
    assert (again.name, again.channel) == ("renamed by the artist", 7)
    assert (len(again.elements), span(again)) == (5, (1, 5))
    second = cut_frame(edit, 4, tmp_path / "second.png")
    assert not np.array_equal(first, second)
    assert np.array_equal(second, read_png(tmp_path / "frames" / "frame_0004.png"))


def test_a_shorter_range_shortens_the_strip(edit, tmp_path):
    files = numbered_files(tmp_path, 6)
    place_strip(edit, StripPlan("job", "film", files, 1))
    strip = place_strip(edit, StripPlan("job", "film", files[:2], 10))
    assert span(strip) == (10, 2)
    assert [element.filename for element in strip.elements] == ["a_0.png", "a_1.png"]
    assert len(edit.sequence_editor.strips) == 1


def test_a_new_strip_takes_the_first_channel_that_is_free_at_its_time(edit, tmp_path):
    files = numbered_files(tmp_path, 4)
    place_strip(edit, StripPlan("one", "one", files, 1))
    assert place_strip(edit, StripPlan("two", "two", files, 3)).channel == 2
    assert place_strip(edit, StripPlan("three", "three", files, 5)).channel == 1
    assert {each[JOB_KEY] for each in edit.sequence_editor.strips} == {"one", "two", "three"}


def test_missing_files_make_no_strip(edit, tmp_path):
    files = numbered_files(tmp_path, 3)
    files[1].unlink()
    with pytest.raises(ShotError, match=r"1 of 3 rendered frames are missing, first .*a_1.png"):
        place_strip(edit, StripPlan("job", "film", files, 1))
    assert len(edit.sequence_editor.strips) == 0


def test_paths_are_relative_once_the_file_is_saved(edit, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "film.blend"))
    strip = place_strip(edit, StripPlan("job", "film", numbered_files(tmp_path / "f", 2), 1))
    assert strip.directory.startswith("//f")
    assert Path(bpy.path.abspath(strip.directory)).resolve() == tmp_path / "f"


def test_a_failed_range_leaves_no_strip_and_gives_the_settings_back(baked, addon, tmp_path):
    addon.use_command(faulty("fails"))
    baked.render.filepath = "//before"
    with pytest.raises(RuntimeError, match="frame 3: the lens fell off"):
        bpy.ops.playable.render_to_sequencer(folder=str(tmp_path / "frames"))
    assert baked.playable_environment.edit_scene is None
    assert baked.render.filepath == "//before"


def test_settings_are_lent_and_given_back_whatever_format_was_chosen(baked, tmp_path):
    output = baked.render.image_settings
    if hasattr(output, "media_type"):
        output.media_type = "VIDEO"
    output.file_format = "FFMPEG"
    with lent_settings(baked, job_for(baked, str(tmp_path))):
        assert (output.file_format, output.color_depth) == ("PNG", "8")
        assert not baked.render.use_sequencer
    assert output.file_format == "FFMPEG" and baked.render.use_sequencer


def test_a_relative_folder_needs_a_saved_file_and_a_step_is_refused(baked):
    with pytest.raises(RuntimeError, match="relative to a file that is not saved"):
        bpy.ops.playable.render_to_sequencer(folder="//frames")
    baked.frame_step = 2
    with pytest.raises(RuntimeError, match="set the frame step to 1"):
        bpy.ops.playable.render_to_sequencer(folder="/tmp")


def test_rendering_to_the_sequencer_before_baking_explains_itself(environment):
    with pytest.raises(RuntimeError, match="press Bake Paths"):
        bpy.ops.playable.render_to_sequencer(folder="/tmp")


def test_a_video_of_odd_size_is_refused_before_rendering(edit, tmp_path):
    edit.render.resolution_x, edit.render.resolution_y = 63, 36
    with pytest.raises(ShotError, match="63x36 pixels; make both numbers even"):
        write_video(edit, tmp_path / "odd.mp4")


def test_every_workspace_whose_sequencer_shows_nothing_shows_the_strip(scene):
    chosen, empty = SimpleNamespace(sequencer_scene="mine"), SimpleNamespace(sequencer_scene=None)
    before_5 = SimpleNamespace()
    show_where_none_is_chosen([chosen, empty, before_5], scene)
    assert (chosen.sequencer_scene, empty.sequencer_scene) == ("mine", scene)
    assert not vars(before_5)
