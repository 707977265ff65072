"""States as files: whole, found again anywhere, and the same pixels as from their picture."""

import contextlib
import dataclasses
import errno
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from addon import real_duel
from addon.stage import opened_picture, read_png

from blender_addon import state_files
from blender_addon.state_files import file_name, portable, state_file, stored_state
from blender_addon.worker.worker_client import WorkerClient
from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.shot import ObjectTrack, Start, StyleMix

TEXT = json.dumps({"format": 1, "objects": {"ground": {"position": [0.0, 0.0, 0.0]}}})


@pytest.fixture(autouse=True)
def temporary(tmp_path, monkeypatch):
    """A folder for temporary files that no other test knows."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def test_a_state_is_written_once_under_the_name_of_its_content(temporary):
    path = state_file(TEXT)
    assert path == temporary / "playable_environments" / file_name(TEXT)
    assert path.read_text() == TEXT
    before = path.stat()
    assert state_file(TEXT) == path and path.stat() == before
    assert state_file(TEXT + " ").name != path.name


def test_a_damaged_or_deleted_file_is_written_again():
    path = state_file(TEXT)
    path.write_text(TEXT[:20])
    assert state_file(TEXT).read_text() == TEXT
    path.unlink()
    assert state_file(TEXT).read_text() == TEXT


def test_where_the_folder_is_somebody_elses_an_own_one_is_used(temporary):
    (temporary / "playable_environments").write_text("not a folder that we may write to")
    path = state_file(TEXT)
    assert path.parent.parent == temporary and path.read_text() == TEXT


def test_a_temporary_folder_that_takes_no_file_is_a_clear_error(monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", "/dev/null/nowhere")
    with pytest.raises(ShotError, match="set TMPDIR to a folder that can be written"):
        state_file(TEXT)


def test_a_full_disk_leaves_no_part_of_a_file(temporary, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(ShotError, match="No space left on device.*free some space"):
        state_file(TEXT)
    assert [each for each in temporary.rglob("*") if each.is_file()] == []


BUSY_WRITER = """
import json, sys, tempfile
from pathlib import Path
from blender_addon.state_files import state_file
tempfile.tempdir = sys.argv[1]
while not Path(sys.argv[1], "enough").exists():
    state_file(json.dumps({"objects": {"x": [0.5] * 20000}})).unlink(missing_ok=True)
"""


def test_blenders_that_write_and_delete_at_the_same_time_never_see_half_a_file(temporary):
    text = json.dumps({"objects": {"x": [0.5] * 20000}})
    command = [sys.executable, "-c", BUSY_WRITER, str(temporary)]
    writers = [subprocess.Popen(command, cwd=Path(__file__).parents[2]) for _ in range(2)]
    path, seen = temporary / "playable_environments" / file_name(text), 0
    try:
        while seen < 50:
            assert [each.poll() for each in writers] == [None, None]
            with contextlib.suppress(OSError):
                assert path.read_text() == text
                seen += 1
    finally:
        (temporary / "enough").touch()
    assert [each.wait(60) for each in writers] == [0, 0]
    assert list(path.parent.iterdir()) == []


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"state": 3}', '{"state": {"objects": []}}'])
def test_a_text_without_a_state_is_refused_by_name(content):
    with pytest.raises(ShotError, match="'Scene environment' is no environment"):
        stored_state(content, "Scene environment")


def test_a_portable_shot_knows_no_temporary_folder(picture, temporary, monkeypatch, tmp_path):
    shot = _shot_from(state_file(TEXT))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    other = _shot_from(state_file(TEXT))
    assert shot != other and portable(shot) == portable(other)
    assert portable(shot).start.state == file_name(TEXT)
    own = dataclasses.replace(shot, start=Start(state="/elsewhere/mine.json"))
    assert portable(own).start.state == "/elsewhere/mine.json"


def _shot_from(path):
    from addon.stage import shot_of

    mix = StyleMix(1, str(path), "player_1", 0.5)
    lent = (ObjectTrack("player_2", styles=(mix,)),)
    return shot_of("unused", start=Start(state=str(path)), objects=lent)


bpy = pytest.importorskip("bpy")
from blender_addon import playables  # noqa: E402 - after the check for Blender
from blender_addon.bake import Bake, bake_of, read_bake  # noqa: E402
from blender_addon.pictures import read_picture  # noqa: E402
from blender_addon.scene_bridge import playable_objects  # noqa: E402


def render_still(scene, path, frame=1):
    scene.frame_set(frame)
    scene.render.image_settings.color_mode = "RGB"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True, scene=scene.name)
    return read_png(path)


@pytest.fixture
def baked(environment):
    playables.key_action(playable_objects(environment)["player_1"], 1, 1)
    bpy.ops.playable.bake_paths()
    return environment


@pytest.mark.blender
def test_a_bake_holds_on_another_machine_without_the_picture(baked, picture, tmp_path, monkeypatch):
    before = render_still(baked, tmp_path / "before.png", 3)
    bake = bake_of(baked.playable_environment)
    assert Path(bake.shot.start.state).name in baked.playable_environment.bake_text.as_string()
    assert str(tempfile.gettempdir()) not in baked.playable_environment.bake_text.as_string()
    file = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=file)
    picture.unlink()
    Path(bake.shot.start.state).unlink()
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(elsewhere))
    bpy.ops.wm.open_mainfile(filepath=file)
    scene = bpy.data.scenes[0]
    assert np.array_equal(render_still(scene, tmp_path / "after.png", 3), before)
    found = bake_of(scene.playable_environment)
    assert Path(found.shot.start.state).is_relative_to(elsewhere)
    assert found.digest == bake.digest and found.shot.digest() != bake.shot.digest()


@pytest.mark.blender
def test_a_state_file_that_is_cleaned_away_between_two_frames_comes_back(baked, tmp_path):
    before = render_still(baked, tmp_path / "before.png")
    bake = bake_of(baked.playable_environment)
    Path(bake.shot.start.state).unlink()
    assert np.array_equal(render_still(baked, tmp_path / "after.png"), before)
    assert bake_of(baked.playable_environment) is bake


@pytest.mark.blender
def test_a_scene_bakes_and_films_without_its_picture(environment, picture, tmp_path):
    picture.unlink()
    bpy.ops.playable.bake_paths()
    assert render_still(environment, tmp_path / "still.png").any()


def as_before_states(scene):
    """The scene's bake as it was written when bakes began with the picture."""
    settings = scene.playable_environment
    bake = bake_of(settings)
    shot = dataclasses.replace(bake.shot, start=opened_picture(scene))
    old = Bake(shot, bake.paths, bake.headings).to_json().replace('"format": 2', '"format": 1', 1)
    playables.write_text(settings.bake_text, "", old)
    return shot


@pytest.mark.blender
def test_an_old_bake_is_filmed_from_the_state_that_its_picture_became(baked, picture, tmp_path):
    before = render_still(baked, tmp_path / "before.png", 3)
    digest = as_before_states(baked).digest()
    assert digest in baked.playable_environment.bake_text.as_string()
    picture.unlink()
    assert np.array_equal(render_still(baked, tmp_path / "after.png", 3), before)


@pytest.mark.blender
def test_an_old_bake_of_another_picture_keeps_its_picture(baked):
    shot = as_before_states(baked)
    settings = baked.playable_environment
    changed = settings.state_text.as_string().replace("picture.png", "other.png")
    playables.write_text(settings.state_text, "", changed)
    assert bake_of(settings).shot.start == shot.start


@pytest.mark.blender
def test_a_bake_of_another_state_asks_to_bake_again(baked):
    settings = baked.playable_environment
    content = json.loads(settings.state_text.as_string())
    content["state"]["objects"]["ground"]["style"] = [0.25]
    playables.write_text(settings.state_text, "", json.dumps(content))
    with pytest.raises(ShotError, match="a state that is no longer in this file; press Bake"):
        bake_of(settings)


@pytest.mark.blender
def test_a_bake_whose_state_was_deleted_does_not_ask_to_bake_again(baked):
    settings = baked.playable_environment
    bpy.data.texts.remove(settings.state_text)
    with pytest.raises(ShotError, match="encoded picture .* undo its deletion, or press New Play"):
        bake_of(settings)


@pytest.mark.blender
def test_a_bake_of_a_newer_addon_says_so(baked):
    text = baked.playable_environment.bake_text.as_string().replace('"format": 2', '"format": 9')
    with pytest.raises(ShotError, match="of format 9, this add-on reads up to 2; update"):
        read_bake(text, "bake")


@pytest.mark.blender
def test_a_worker_that_starts_from_the_state_draws_the_bits_of_the_picture():
    client = WorkerClient(real_duel.WORKER)
    try:
        client.load("duel")
        shot = real_duel.duel_shot()
        begin = shot.start
        state = client.encode(read_picture(begin.image), begin.camera, begin.boxes)
        # By the way of a .blend's text block.
        kept = stored_state(json.dumps({"state": state}), "kept")
        as_state = dataclasses.replace(shot, start=Start(state=str(state_file(kept))))
        for frame in (1, 3):
            a, b = client.render(shot, frame), client.render(as_state, frame)
            assert a.rgb.std() > 5 and np.array_equal(a.rgb, b.rgb)
            assert np.array_equal(a.depth, b.depth)
        paths = client.rollout(shot).positions, client.rollout(as_state).positions
        assert all(np.array_equal(paths[0][name], paths[1][name]) for name in begin.boxes)
    finally:
        client.stop()


def test_the_module_needs_no_blender():
    assert not hasattr(state_files, "bpy")
