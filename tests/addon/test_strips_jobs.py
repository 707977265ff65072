"""Ranges as jobs: what is drawn again and what is not, and whose files they are."""

import json
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from addon.stage import faulty, read_png

bpy = pytest.importorskip("bpy")
from blender_addon import playables, windows  # noqa: E402 - after the check for Blender
from blender_addon.scene_bridge import playable_objects  # noqa: E402
from blender_addon.strips import lending  # noqa: E402
from blender_addon.strips.manifest import FILE_NAME, read_manifest  # noqa: E402

pytestmark = pytest.mark.blender
COUNT = 8


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
def drawn(monkeypatch):
    """The frames that Blender has saved since the last look, in order."""
    saved = []

    def note(scene, *_):
        saved.append(scene.frame_current)

    bpy.app.handlers.render_write.append(note)
    yield lambda: [saved.pop(0) for _ in range(len(saved))]
    if note in bpy.app.handlers.render_write:
        bpy.app.handlers.render_write.remove(note)


def render(frames, **options):
    return bpy.ops.playable.render_to_sequencer(folder=str(frames), **options)


def everything(count=COUNT):
    return list(range(1, count + 1))


def pictures(frames):
    return {path.name: path.read_bytes() for path in sorted(frames.glob("*.png"))}


def key_action_from(scene, frame):
    """Change what a player does from a frame on, and what follows from it."""
    playables.key_action(playable_objects(scene)["player_1"], frame, 2)
    bpy.ops.playable.bake_paths()


def test_a_job_redraws_the_sidebars_that_tell_of_it_and_no_view(monkeypatch):
    told = []

    def region(kind):
        return SimpleNamespace(type=kind, tag_redraw=lambda: told.append(kind))

    area = SimpleNamespace(type="VIEW_3D", regions=[region("WINDOW"), region("UI")])
    area.tag_redraw = lambda: told.append("AREA")
    monkeypatch.setattr(windows, "areas", lambda *kinds: [area] if area.type in kinds else [])
    windows.redraw_sidebars("SEQUENCE_EDITOR")
    assert told == []
    windows.redraw_sidebars("SEQUENCE_EDITOR", "VIEW_3D")
    assert told == ["UI"]
    windows.redraw("VIEW_3D")
    assert told == ["UI", "AREA"]


def test_a_second_time_nothing_is_drawn(baked, frames, drawn):
    render(frames)
    assert drawn() == everything()
    before = {path: path.stat().st_mtime_ns for path in frames.glob("*.png")}
    assert render(frames) == {"FINISHED"}
    assert drawn() == []
    assert {path: path.stat().st_mtime_ns for path in frames.glob("*.png")} == before


def test_a_missing_frame_alone_is_drawn_again(baked, frames, drawn):
    render(frames)
    drawn()
    before = pictures(frames)
    (frames / "frame_0003.png").unlink()
    render(frames)
    assert drawn() == [3]
    assert pictures(frames) == before


def test_frames_before_a_changed_key_stay_and_those_after_it_are_drawn(baked, frames, drawn):
    render(frames)
    drawn()
    key_action_from(baked, 5)
    render(frames)
    changed = drawn()
    assert changed == list(range(changed[0], COUNT + 1)) and 4 < changed[0] <= 7


def test_gaps_are_drawn_in_one_go_and_what_lies_between_stays(baked, frames, drawn):
    render(frames)
    drawn()
    before = pictures(frames)
    for number in (2, 5, 6):
        (frames / f"frame_000{number}.png").unlink()
    render(frames)
    assert drawn() == [2, 5, 6]
    after = pictures(frames)
    for number in (1, 3, 4, 7, 8):
        name = f"frame_000{number}.png"
        assert after[name] == before[name]
    assert all(content.startswith(b"\x89PNG") for content in after.values())


def move_camera(scene):
    scene.camera.location.x += 0.25


def hide_a_player(scene):
    playable_objects(scene)["player_2"].hide_render = True


def other_quality(scene):
    scene.playable_environment.quality = "draft"


def other_view(scene):
    scene.view_settings.exposure = 1.0


def other_size(scene):
    scene.render.resolution_percentage = 50


def with_border(scene):
    render = scene.render
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x = 0.21, 0.77
    render.border_min_y, render.border_max_y = 0.11, 0.93


@pytest.mark.parametrize(
    "change", [move_camera, hide_a_player, other_quality, other_view, other_size, with_border]
)
def test_whatever_changes_pixels_is_noticed(baked, frames, drawn, change):
    render(frames)
    drawn()
    change(baked)
    render(frames)
    assert drawn() == everything()
    render(frames)
    assert drawn() == []


def other_camera_name(scene):
    scene.camera.name = "Renamed"


def other_engine(scene):
    scene.render.engine = "BLENDER_WORKBENCH"


def other_format(scene):
    scene.render.image_settings.file_format = "JPEG"


def longer_range_than_baked_before(scene):
    scene.frame_end = COUNT - 2


@pytest.mark.parametrize(
    "change",
    [other_camera_name, other_engine, other_format, longer_range_than_baked_before],
)
def test_what_changes_no_pixel_costs_nothing(baked, frames, drawn, change):
    render(frames)
    drawn()
    change(baked)
    render(frames)
    assert drawn() == []


def test_everything_is_drawn_again_where_that_is_wanted(baked, frames, drawn):
    render(frames)
    drawn()
    render(frames, everything=True)
    assert drawn() == everything()
    baked.playable_environment.strips.only_changed = False
    render(frames)
    assert drawn() == everything()


def test_a_range_is_resumed_where_a_failure_ended_it(baked, addon, frames, drawn):
    addon.use_command(faulty("fails"))
    with pytest.raises(RuntimeError, match="frame 3: the lens fell off"):
        render(frames)
    assert sorted(pictures(frames)) == ["frame_0001.png", "frame_0002.png"]
    assert drawn() == [1, 2]
    from addon.stage import FAKE

    addon.use_command(FAKE)
    render(frames)
    assert drawn() == everything()[2:]


def test_files_of_others_are_never_touched_unless_that_is_allowed(baked, frames, drawn):
    frames.mkdir()
    (frames / "frame_0002.png").write_bytes(b"a painting")
    with pytest.raises(RuntimeError, match=r"1 of the files .*frame_0002.png.*allow overwriting"):
        render(frames)
    assert drawn() == [] and (frames / "frame_0002.png").read_bytes() == b"a painting"
    render(frames, overwrite=True)
    assert drawn() == everything()
    assert read_png(frames / "frame_0002.png").shape[2] == 3


def test_a_frame_that_was_painted_over_is_not_lost(baked, frames, drawn):
    render(frames)
    drawn()
    shutil.copy(frames / "frame_0001.png", frames / "frame_0004.png")
    with pytest.raises(RuntimeError, match=r"frame_0004.png"):
        render(frames)
    assert drawn() == []
    render(frames, overwrite=True)
    assert drawn() == [4]


def test_frames_of_another_scene_in_the_same_folder_are_not_taken_for_ones_own(
    baked, frames, drawn
):
    render(frames)
    drawn()
    baked.playable_environment.job = "another scene's"
    with pytest.raises(RuntimeError, match="8 of the files were not written by this job"):
        render(frames)


def test_files_beside_the_frames_stay_as_they_are(baked, frames):
    frames.mkdir()
    (frames / "frame_0099.png").write_bytes(b"out of range")
    (frames / "notes.txt").write_text("mine")
    render(frames)
    render(frames, everything=True)
    assert (frames / "frame_0099.png").read_bytes() == b"out of range"
    assert (frames / "notes.txt").read_text() == "mine"


def test_a_damaged_manifest_is_told_and_nothing_is_lost(baked, frames, drawn, capfd):
    render(frames)
    drawn()
    (frames / FILE_NAME).write_text("{ half of it")
    with pytest.raises(RuntimeError, match="8 of the files"):
        render(frames)
    capfd.readouterr()
    assert render(frames, overwrite=True) == {"FINISHED"}
    assert "nothing is known of the frames beside it" in capfd.readouterr().out
    assert (frames / f"{FILE_NAME}.unreadable").read_text() == "{ half of it"
    assert drawn() == everything()
    render(frames)
    assert drawn() == []


def with_compositor(scene):
    scene.render.use_compositing = True
    if "compositing_node_group" in scene.bl_rna.properties:
        tree = bpy.data.node_groups.new("comp", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        end = tree.nodes.new("NodeGroupOutput")
        layer = tree.nodes.new("CompositorNodeRLayers")
        tree.links.new(layer.outputs["Image"], end.inputs[0])
        scene.compositing_node_group = tree
    else:
        scene.use_nodes = True


def with_stamp(scene):
    scene.render.use_stamp = True


@pytest.mark.parametrize(
    ("change", "reason"),
    [(with_compositor, "compositor nodes may change"), (with_stamp, "burnt-in metadata changes")],
)
def test_where_nothing_can_be_known_everything_is_drawn_and_that_is_said(
    baked, frames, drawn, capfd, change, reason
):
    change(baked)
    render(frames)
    assert drawn() == everything()
    capfd.readouterr()
    render(frames)
    assert drawn() == everything()
    assert reason in capfd.readouterr().out


def test_the_notes_name_every_frame_and_its_digest(baked, frames):
    render(frames)
    notes = read_manifest(frames).frames
    assert list(notes) == everything()
    assert len({note.digest for note in notes.values()}) == COUNT
    assert all(note.file and note.job for note in notes.values())
    assert json.loads((frames / FILE_NAME).read_text())["schema"] == 1


def test_part_of_a_range_is_rendered_by_a_script_and_makes_no_strip(baked, frames, drawn):
    assert bpy.ops.playable.render_range(folder=str(frames), frame_start=3, frame_end=5) == {
        "FINISHED"
    }
    assert drawn() == [3, 4, 5]
    assert baked.playable_environment.edit_scene is None
    assert (baked.frame_start, baked.frame_end) == (1, COUNT)
    render(frames)
    assert drawn() == [1, 2, 6, 7, 8]
    with pytest.raises(RuntimeError, match="expected a range of frames, found 5 to 3"):
        bpy.ops.playable.render_range(folder=str(frames), frame_start=5, frame_end=3)


def test_a_frame_drawn_alone_has_the_pixels_that_the_whole_range_gives_it(baked, tmp_path):
    render(tmp_path / "whole")
    bpy.ops.playable.render_range(folder=str(tmp_path / "part"), frame_start=5, frame_end=5)
    name = "frame_0005.png"
    assert np.array_equal(read_png(tmp_path / "whole" / name), read_png(tmp_path / "part" / name))


def test_settings_lent_at_the_time_of_a_crash_come_back_with_the_file(baked, tmp_path):
    baked.render.filepath, path = "//mine", tmp_path / "crashed.blend"
    job = lending.RangeJob(baked.name, tmp_path, 2, 3)
    with lending.lent_settings(baked, job):
        assert lending.is_lent(baked) and (baked.frame_start, baked.frame_end) == (2, 3)
        bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    assert not lending.is_lent(baked) and baked.render.filepath == "//mine"
    bpy.ops.wm.open_mainfile(filepath=str(path))
    opened = bpy.data.scenes[0]
    assert not lending.is_lent(opened)
    assert opened.render.filepath == "//mine"
    assert (opened.frame_start, opened.frame_end) == (1, COUNT)


def test_settings_come_back_to_a_scene_that_was_renamed_and_not_to_one_that_is_gone(
    baked, tmp_path
):
    baked.render.filepath = "//mine"
    with lending.lent_settings(baked, lending.RangeJob(baked.name, tmp_path, 2, 3)):
        baked.name = "Renamed meanwhile"
    assert baked.render.filepath == "//mine"
    other = bpy.data.scenes.new("short-lived")
    with lending.lent_settings(other, lending.RangeJob(other.name, tmp_path, 2, 3)):
        bpy.data.scenes.remove(other)
    assert not any(map(lending.is_lent, bpy.data.scenes))
