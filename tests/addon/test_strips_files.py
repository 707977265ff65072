"""The files of a job without Blender: whole or not, noted or not, ours or somebody else's."""

import json
import os
import socket
import threading
import time

import numpy as np
import pytest

from blender_addon.strips import manifest, staging
from blender_addon.strips.manifest import FILE_NAME, FrameNote, note_frames, read_manifest
from blender_addon.strips.staging import staging_folder
from blender_addon.strips.whole_files import check_png, facts_of
from pe_runtime.contract.errors import ShotError
from pe_runtime.images import write_png


@pytest.fixture
def png(tmp_path):
    path = tmp_path / "picture.png"
    write_png(path, np.random.default_rng(1).integers(0, 256, (36, 64, 3)).astype(np.uint8))
    return path


def test_a_whole_picture_of_the_right_size_passes(png):
    check_png(png.read_bytes(), (64, 36), png)


def test_a_picture_cut_off_anywhere_is_seen(png):
    content = png.read_bytes()
    for length in [0, 7, 8, 20, 40, *range(60, len(content), 211), len(content) - 1]:
        with pytest.raises(ShotError, match=r"picture.png was not written whole"):
            check_png(content[:length], (64, 36), png)


def test_a_flipped_bit_or_another_size_or_kind_is_seen(png, tmp_path):
    content = bytearray(png.read_bytes())
    content[len(content) // 2] ^= 1
    with pytest.raises(ShotError, match="not written whole"):
        check_png(bytes(content), (64, 36), png)
    with pytest.raises(ShotError, match="expected an 8-bit RGB picture of 64x37 pixels"):
        check_png(png.read_bytes(), (64, 37), png)
    with pytest.raises(ShotError, match="not written whole"):
        check_png(b"GIF89a" + bytes(400), (64, 36), png)


def note(digest="d", job="job"):
    return FrameNote(job, digest, facts_of(digest.encode()))


def test_notes_are_read_as_they_were_written_and_added_to(tmp_path):
    note_frames(tmp_path, {1: note("a"), 2: FrameNote("job")})
    note_frames(tmp_path, {2: note("b"), -3: note("c", job="other")})
    assert read_manifest(tmp_path).frames == {-3: note("c", "other"), 1: note("a"), 2: note("b")}
    assert [each.name for each in tmp_path.iterdir()] == [FILE_NAME]
    assert json.loads((tmp_path / FILE_NAME).read_text())["schema"] == manifest.SCHEMA


@pytest.mark.parametrize(
    "text", ["", "{", "[]", '{"schema": 1}', '{"schema": 99, "frames": {}}', '{"schema": 1, "fra']
)
def test_a_damaged_or_newer_manifest_is_a_warning_and_is_kept(tmp_path, text):
    (tmp_path / FILE_NAME).write_text(text)
    found = read_manifest(tmp_path)
    assert found.frames == {} and "cannot be read" in found.warning
    note_frames(tmp_path, {1: note()})
    assert read_manifest(tmp_path).frames == {1: note()}
    assert (tmp_path / f"{FILE_NAME}.unreadable").read_text() == text


def test_processes_that_note_at_once_lose_nothing(tmp_path):
    def write(first):
        for frame in range(first, first + 20):
            note_frames(tmp_path, {frame: note(str(frame))})

    threads = [threading.Thread(target=write, args=(first,)) for first in (0, 100, 200)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert len(read_manifest(tmp_path).frames) == 60


def test_a_lock_that_a_killed_process_left_is_broken(tmp_path):
    lock = tmp_path / manifest.LOCK_NAME
    lock.touch()
    long_ago = time.time() - 2 * manifest.LOCK_SECONDS
    os.utime(lock, (long_ago, long_ago))
    note_frames(tmp_path, {1: note()})
    assert not lock.exists() and 1 in read_manifest(tmp_path).frames


def test_a_lock_that_is_held_is_waited_for_and_then_named(tmp_path, monkeypatch):
    (tmp_path / manifest.LOCK_NAME).touch()
    monkeypatch.setattr(manifest, "LOCK_SECONDS", 0.1)
    monkeypatch.setattr(manifest, "_break_if_left", lambda _lock: None)
    with pytest.raises(ShotError, match="another process holds"):
        note_frames(tmp_path, {1: note()})


def test_blender_writes_beside_the_frames_folder_and_the_place_is_gone_afterwards(tmp_path):
    frames = tmp_path / "frames"
    with pytest.raises(KeyError), staging_folder(frames) as staged:
        assert staged.parent == tmp_path and staged.is_dir()
        assert list(frames.iterdir()) == []
        (staged / "half.png").write_bytes(b"half")
        raise KeyError
    assert [each.name for each in tmp_path.iterdir()] == ["frames"]


def test_what_a_killed_process_left_is_cleared_and_what_a_living_one_holds_is_not(tmp_path):
    frames, host = tmp_path / "frames", socket.gethostname()
    frames.mkdir()
    dead, alive, far = (
        tmp_path / f".frames{staging.MARK}{name}"
        for name in (f"{host}-999999999", f"{host}-{os.getppid()}", "elsewhere-12")
    )
    for each in (dead, alive, far):
        each.mkdir()
        (each / "frame_0001.png").touch()
    with staging_folder(frames):
        assert not dead.exists() and alive.exists() and far.exists()
    long_ago = time.time() - 2 * staging.DAY
    os.utime(far, (long_ago, long_ago))
    with staging_folder(frames):
        assert not far.exists()


def test_a_place_where_nothing_can_be_written_is_named(tmp_path):
    (tmp_path / "file").touch()
    with (
        pytest.raises(ShotError, match="cannot write in the frames folder"),
        staging_folder(tmp_path / "file" / "frames"),
    ):
        pass
