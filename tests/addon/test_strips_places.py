"""Where a job's strip goes, what of it stays the artist's, and what is known from it."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from addon.stage import read_png

bpy = pytest.importorskip("bpy")
from blender_addon import playables  # noqa: E402 - after the check for Blender
from blender_addon.bake import bake_of  # noqa: E402
from blender_addon.filming.frame_origin import state_digest  # noqa: E402
from blender_addon.scene_bridge import playable_objects  # noqa: E402
from blender_addon.strips.placing import StripPlan, place_strip, strips_of  # noqa: E402
from blender_addon.strips.provenance import read_provenance, scene_of_strip  # noqa: E402
from blender_addon.strips.relative_paths import make_relative  # noqa: E402
from blender_addon.strips.strip_operators import active_strip  # noqa: E402
from blender_addon.strips.target import shadowed  # noqa: E402
from blender_addon.strips.timing import Timing, read_timing, span, write_timing  # noqa: E402
from pe_runtime.contract.errors import ShotError  # noqa: E402

pytestmark = pytest.mark.blender
COUNT = 6


@pytest.fixture
def baked(environment):
    environment.frame_end = COUNT
    playables.key_action(playable_objects(environment)["player_1"], 1, 1)
    bpy.ops.playable.bake_paths()
    return environment


@pytest.fixture
def frames(tmp_path):
    return tmp_path / "frames"


@pytest.fixture
def cut(scene):
    """A scene of the artist's own, with a sequencer and a film that is being cut."""
    made = bpy.data.scenes.new("Film")
    made.render.fps, made.render.engine = 10, "BLENDER_WORKBENCH"
    made.render.resolution_x, made.render.resolution_y = 64, 36
    made.view_settings.view_transform = "Standard"
    made.sequence_editor_create()
    return made


def render(frames, **options):
    return bpy.ops.playable.render_to_sequencer(folder=str(frames), **options)


def the_strip(scene, target=None):
    target = target or scene.playable_environment.edit_scene
    (strip,) = strips_of(target, scene.playable_environment.job)
    return strip


def shown(target, frame, path):
    """One frame of a scene's sequencer, as bytes."""
    target.frame_start = target.frame_end = frame
    target.render.image_settings.color_mode = "RGB"
    target.render.use_file_extension, target.render.filepath = False, str(path)
    bpy.ops.render.render(animation=True, scene=target.name)
    return read_png(f"{path}{frame:04d}")


def as_files(folder, first, last):
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"frame_{number:04d}.png" for number in range(first, last + 1)]
    for file in files:
        file.write_bytes(b"")
    return files


def plan(files, start, **more):
    return StripPlan("job", "film", files, start, **more)


def test_the_strip_goes_to_the_chosen_scene_channel_and_time(baked, cut, frames):
    strips = baked.playable_environment.strips
    strips.target, strips.channel, strips.frame_offset = cut, 5, 100
    render(frames)
    strip = the_strip(baked, cut)
    assert (strip.channel, span(strip)) == (5, (101, COUNT))
    assert baked.playable_environment.edit_scene is None


def test_a_chosen_scene_keeps_its_own_settings(baked, cut, frames):
    cut.render.fps, cut.frame_end, cut.render.resolution_x = 10, 999, 128
    cut.view_settings.exposure = 0.5
    baked.playable_environment.strips.target = cut
    render(frames)
    kept = (cut.render.fps, cut.frame_end, cut.render.resolution_x, cut.view_settings.exposure)
    assert kept == (10, 999, 128, 0.5)


def test_another_pace_and_other_colours_of_the_chosen_scene_are_said(baked, cut, frames, capfd):
    cut.render.fps, cut.view_settings.exposure = 25, 1.0
    baked.playable_environment.strips.target = cut
    render(frames)
    said = capfd.readouterr().out
    assert "plays 2.5 times as fast; give both scenes one frame rate" in said
    assert "changes the strip's colours: Exposure is 1, not 0\n" in said


def test_the_edit_scene_shows_the_files_bytes_at_any_percentage_and_border(baked, frames, tmp_path):
    render_settings = baked.render
    render_settings.resolution_percentage = 75
    render_settings.use_border = render_settings.use_crop_to_border = True
    render_settings.border_min_x, render_settings.border_max_x = 0.13, 0.81
    render_settings.border_min_y, render_settings.border_max_y = 0.07, 0.93
    render(frames)
    picture = shown(baked.playable_environment.edit_scene, 2, tmp_path / "cut.png")
    assert np.array_equal(picture, read_png(frames / "frame_0002.png"))


def test_what_the_artist_made_of_the_strip_stays(baked, frames):
    render(frames)
    strip = the_strip(baked)
    edit = baked.playable_environment.edit_scene
    strip.name, strip.channel, strip.mute, strip.blend_alpha = "mine", 4, True, 0.5
    strip.blend_type, strip.color_tag = "ADD", "COLOR_03"
    strip.transform.offset_x, strip.transform.scale_x = 12, 0.5
    blur = edit.sequence_editor.strips.new_effect(
        name="blur", type="GAUSSIAN_BLUR", channel=6, **_effect_input(strip)
    )
    playables.key_action(playable_objects(baked)["player_1"], 3, 2)
    baked.frame_end = COUNT + 2
    bpy.ops.playable.bake_paths()
    render(frames)
    again = the_strip(baked)
    kept = (again.name, again.channel, again.mute, again.blend_alpha, again.blend_type)
    assert kept == ("mine", 4, True, 0.5, "ADD")
    assert (again.color_tag, again.transform.offset_x, again.transform.scale_x) == (
        "COLOR_03",
        12,
        0.5,
    )
    assert blur.input_1 == again and len(again.elements) == COUNT + 2


def _effect_input(strip):
    names = bpy.types.StripsTopLevel.bl_rna.functions["new_effect"].parameters.keys()
    length = {"length": COUNT} if "length" in names else {"frame_end": 1 + COUNT}
    return {"frame_start": 1, "input1" if "input1" in names else "seq1": strip} | length


def test_a_strip_that_was_moved_stays_where_it_was_moved_to(cut, tmp_path):
    strip = place_strip(cut, plan(as_files(tmp_path, 1, 6), 1))
    write_timing(strip, Timing(50, 6))
    place_strip(cut, plan(as_files(tmp_path, 1, 8), 1))
    assert span(strip) == (50, 8)
    # Earlier frames stand before the ones that were there.
    place_strip(cut, plan(as_files(tmp_path, -1, 8), -1))
    assert span(strip) == (48, 10)


def test_a_changed_offset_moves_the_strip_by_the_difference(cut, tmp_path):
    files = as_files(tmp_path, 1, 6)
    strip = place_strip(cut, plan(files, 1))
    write_timing(strip, Timing(50, 6))
    place_strip(cut, plan(files, 11))
    assert span(strip) == (60, 6)


@pytest.mark.parametrize(
    ("first", "last", "expected"),
    [
        (1, 10, Timing(1, 10, 2, 3)),
        (0, 10, Timing(0, 11, 3, 3)),
        (2, 12, Timing(2, 11, 1, 5)),
        (5, 7, Timing(5, 3, 0, 0)),
    ],
)
def test_a_trimmed_strip_shows_the_same_pictures_at_the_same_time(
    cut, tmp_path, first, last, expected
):
    strip = place_strip(cut, plan(as_files(tmp_path, 1, 10), 1))
    write_timing(strip, Timing(1, 10, 2, 3))
    assert span(strip) == (3, 5)
    place_strip(cut, plan(as_files(tmp_path / "again", first, last), first))
    assert read_timing(strip) == expected


def test_pieces_of_a_strip_that_was_cut_are_all_renewed(cut, tmp_path):
    files = as_files(tmp_path, 1, 10)
    strip = place_strip(cut, plan(files, 1))
    other = place_strip(cut, StripPlan("copy", "film", files, 1))
    other["playable_environment_job"] = "job"
    write_timing(strip, Timing(1, 10, 0, 6))
    write_timing(other, Timing(1, 10, 4, 0))
    place_strip(cut, plan(as_files(tmp_path / "again", 1, 10), 1))
    assert {read_timing(each) for each in (strip, other)} == {
        Timing(1, 10, 0, 6),
        Timing(1, 10, 4, 0),
    }
    assert all(each.directory.rstrip("/").endswith("again") for each in (strip, other))


def test_a_strip_inside_a_meta_strip_is_found_and_renewed(cut, tmp_path):
    strip = place_strip(cut, plan(as_files(tmp_path, 1, 6), 1))
    strips = cut.sequence_editor.strips
    meta = strips.new_meta("meta", channel=3, frame_start=1)
    strip.move_to_meta(meta)
    assert place_strip(cut, plan(as_files(tmp_path, 1, 7), 1)) == strip
    assert len(strip.elements) == 7 and len(meta.strips) == 1


def test_new_pixels_show_in_every_strip_that_shows_the_files(baked, cut, frames, tmp_path):
    baked.playable_environment.strips.target = cut
    render(frames)
    files = sorted(frames.glob("*.png"))
    foreign = cut.sequence_editor.strips.new_image("own", str(files[0]), channel=9, frame_start=20)
    before = shown(cut, 4, tmp_path / "a.png"), shown(cut, 20, tmp_path / "b.png")
    baked.camera.location.x += 0.5
    render(frames)
    after = shown(cut, 4, tmp_path / "c.png"), shown(cut, 20, tmp_path / "d.png")
    assert not np.array_equal(before[0], after[0]) and not np.array_equal(before[1], after[1])
    assert np.array_equal(after[0], read_png(files[3]))
    assert np.array_equal(after[1], read_png(files[0])) and foreign.channel == 9


def test_frames_that_were_kept_after_a_failure_show_too(baked, frames, addon, tmp_path):
    from addon.stage import faulty

    render(frames)
    edit = baked.playable_environment.edit_scene
    before = shown(edit, 1, tmp_path / "a.png")
    baked.camera.location.x += 0.5
    addon.use_command(faulty("fails"))
    with pytest.raises(RuntimeError, match="the lens fell off"):
        render(frames)
    after = shown(edit, 1, tmp_path / "b.png")
    assert not np.array_equal(before, after)
    assert np.array_equal(after, read_png(frames / "frame_0001.png"))


def test_the_strip_says_where_it_comes_from(baked, frames, addon):
    began = datetime.now(UTC) - timedelta(seconds=1)
    baked.camera.name = "Main Camera"
    render(frames)
    found = read_provenance(the_strip(baked))
    settings = baked.playable_environment
    assert datetime.fromisoformat(found.pop("rendered")) >= began
    assert found == {
        "model": "fake",
        "model_digest": addon.facts("fake").digest,
        "state": state_digest(bake_of(settings).shot),
        "shot": bake_of(settings).digest,
        "camera": "Main Camera",
        "quality": "exact",
        "version": __import__("pe_runtime").__version__,
        "scene": baked.name,
    }
    assert len(addon.facts("fake").digest) == 64


def test_the_time_of_rendering_stays_where_nothing_was_rendered(baked, frames):
    render(frames)
    strip = the_strip(baked)
    strip["playable_rendered"] = "2001-01-01T00:00:00+00:00"
    render(frames)
    assert strip["playable_rendered"] == "2001-01-01T00:00:00+00:00"
    render(frames, everything=True)
    assert strip["playable_rendered"] > "2020"


def test_the_environments_own_scene_is_refused_unless_the_sequencer_is_left_out(baked, frames):
    strips = baked.playable_environment.strips
    strips.target = baked
    with pytest.raises(RuntimeError, match="rendered in place of that scene's environment"):
        render(frames)
    assert not frames.exists()
    strips.share_scene = True
    render(frames)
    assert the_strip(baked, baked) is not None
    assert not baked.render.use_sequencer and shadowed(baked) == ""


def test_a_scene_that_renders_its_sequencer_is_told_and_mended_by_one_click(baked, frames, cut):
    assert shadowed(baked) == "" and shadowed(cut) == ""
    baked.sequence_editor_create()
    assert shadowed(baked) == ""
    strip = place_strip(baked, plan(as_files(frames, 1, 3), 1))
    assert "strip 'film' would be rendered in place of the environment" in shadowed(baked)
    strip.mute = True
    assert shadowed(baked) == ""
    strip.mute = False
    baked.sequence_editor.channels[strip.channel].mute = True
    assert shadowed(baked) == ""
    baked.sequence_editor.channels[strip.channel].mute = False
    bpy.ops.playable.leave_sequencer_out()
    assert shadowed(baked) == "" and not baked.render.use_sequencer


def make_active(scene, strip):
    scene.sequence_editor.active_strip = strip


def looking_at(scene):
    """The context of a sequencer editor that shows a scene."""
    names = {"scene": scene}
    if "sequencer_scene" in dir(bpy.context):
        names["sequencer_scene"] = scene
    return bpy.context.temp_override(**names)


def test_render_again_finds_the_environment_after_renames_and_draws_what_changed(baked, frames):
    render(frames)
    edit = baked.playable_environment.edit_scene
    baked.name, edit.name = "renamed", "renamed too"
    baked.camera.location.x += 0.5
    before = (frames / "frame_0001.png").read_bytes()
    make_active(edit, the_strip(baked))
    with looking_at(edit):
        assert active_strip(bpy.context) == the_strip(baked)
        assert bpy.ops.playable.render_again() == {"FINISHED"}
    assert (frames / "frame_0001.png").read_bytes() != before
    assert the_strip(baked)["playable_scene"] == "renamed"
    assert len(list(frames.parent.glob("*"))) == 2  # the picture and the frames


def test_render_again_says_why_it_cannot(baked, frames, cut):
    render(frames)
    edit = baked.playable_environment.edit_scene
    with looking_at(cut), pytest.raises(RuntimeError, match="Select a strip that was rendered"):
        bpy.ops.playable.render_again()
    make_active(edit, the_strip(baked))
    the_strip(baked)["playable_environment_job"] = "of another file"
    with looking_at(edit), pytest.raises(RuntimeError, match="is not in this file"):
        bpy.ops.playable.render_again()


def test_select_environment_selects_the_root_in_its_scene(baked, frames):
    render(frames)
    edit = baked.playable_environment.edit_scene
    make_active(edit, the_strip(baked))
    with looking_at(edit):
        assert bpy.ops.playable.select_environment() == {"FINISHED"}
    layer = baked.view_layers[0]
    root = baked.playable_environment.root
    assert layer.objects.active == root
    assert [each for each in layer.objects if each.select_get(view_layer=layer)] == [root]


def test_a_folder_that_is_gone_is_told(baked, frames):
    render(frames)
    edit = baked.playable_environment.edit_scene
    make_active(edit, the_strip(baked))
    frames.rename(frames.with_name("elsewhere"))
    with looking_at(edit), pytest.raises(RuntimeError, match="does not exist any more"):
        bpy.ops.playable.open_frames_folder()


def test_two_scenes_of_one_job_are_told_apart_by_name(baked, frames):
    render(frames)
    strip = the_strip(baked)
    copy = baked.copy()
    assert scene_of_strip(strip) == baked
    with bpy.context.temp_override(scene=copy):
        bpy.ops.playable.render_to_sequencer(folder=str(frames.with_name("second")))
    assert copy.playable_environment.job != baked.playable_environment.job
    assert strip.directory.rstrip("/").endswith("frames")


def test_folders_become_relative_once_the_file_has_a_place(baked, frames, tmp_path):
    render(frames)
    strip = the_strip(baked)
    assert Path(strip.directory).is_absolute() and not strip.directory.startswith("//")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "film.blend"), relative_remap=False)
    assert make_relative(bpy.data.filepath) in (0, 1)
    assert strip.directory.startswith("//frames")
    elsewhere = tmp_path / "deeper" / "film.blend"
    elsewhere.parent.mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(elsewhere))
    assert make_relative(bpy.data.filepath) == 0
    assert Path(bpy.path.abspath(strip.directory)).resolve() == frames
    assert render(frames) == {"FINISHED"}
    assert strip.directory.startswith("//..")


def test_where_the_chosen_channel_is_taken_the_next_free_one_above_it_is_used(cut, tmp_path):
    files = as_files(tmp_path, 1, 3)
    for channel in (1, *range(4, 129)):
        cut.sequence_editor.strips.new_image("x", str(files[0]), channel=channel, frame_start=1)
    with pytest.raises(ShotError, match="all channels from 4 to 128 are taken from frame 1 to 4"):
        place_strip(cut, plan(files, 1, channel=4))
    assert place_strip(cut, plan(files, 1)).channel == 2
    assert place_strip(cut, StripPlan("other", "film", files, 1, channel=2)).channel == 3
