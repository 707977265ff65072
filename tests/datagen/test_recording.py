"""The driver of the recording processes, against a stand-in for the Python that has Blender."""

import os
import sys
import time
from pathlib import Path

import pytest

from pe_runtime import recording
from pe_runtime.contract.episode import DatasetInfo, read_info, write_dataset
from pe_runtime.contract.errors import EpisodeError
from pe_runtime.recording import RecordingJob, record, split

# Takes the recorder's options, and leaves what the driver looks at: episode.json and a line.
STAND_IN = """#!{python}
import json, os, pathlib, sys, time
sys.path.insert(0, {root!r})
options = dict(zip(sys.argv[3::2], sys.argv[4::2]))
at = sys.argv.index("--sequence-range")
first, end = int(sys.argv[at + 1]), int(sys.argv[at + 2])
out = pathlib.Path(options["--output"])
with (out / "pids").open("a") as pids:
    pids.write(f"{{os.getpid()}}\\n")
if not (out / "dataset.json").exists():
    from pe_runtime.contract.episode import DatasetInfo, write_dataset
    width, height = map(int, options["--size"].split("x"))
    write_dataset(out, DatasetInfo("duel", int(options["--seed"]), int(options["--count"]), 5.0,
                                   width, height, ("a",), ("idle",), int(options["--views"])))
for number in range(first, end):
    {each}
    folder = out / f"{{number:05d}}"
    folder.mkdir(exist_ok=True)
    with (folder / "episode.json").open("a") as file:
        file.write("written\\n")
    print(json.dumps({{"episode": number}}), flush=True)
"""


def stand_in(folder, each="pass"):
    path = folder / "python"
    root = os.fspath(Path(recording.__file__).parents[1])
    path.write_text(STAND_IN.format(python=sys.executable, root=root, each=each))
    path.chmod(0o755)
    return str(path)


def job(folder, sequences=7, **changes):
    return RecordingJob("duel", sequences, 1, (64, 36), folder / "data", **changes)


def written(folder):
    """How often each episode was written to its end."""
    found = {}
    for path in sorted((folder / "data").glob("*/episode.json")):
        found[int(path.parent.name)] = path.read_text().count("written")
    return found


def running(folder):
    """The processes that were started and still live."""
    pids = (folder / "data" / "pids").read_text().split()
    return [pid for pid in pids if Path(f"/proc/{pid}").exists()]


def test_every_episode_is_recorded_once_by_several_processes(tmp_path):
    seen = []
    info = record(job(tmp_path), 3, stand_in(tmp_path), lambda *counts: seen.append(counts))
    assert written(tmp_path) == dict.fromkeys(range(7), 1)
    assert seen == [(done, 7) for done in range(8)]
    assert info.count == 7


def test_complete_episodes_are_kept_and_missing_ones_redone(tmp_path):
    python = stand_in(tmp_path)
    record(job(tmp_path), 1, python)
    for number in (2, 5):
        (tmp_path / "data" / f"{number:05d}" / "episode.json").unlink()
    record(job(tmp_path), 2, python)
    assert written(tmp_path) == dict.fromkeys(range(7), 1)


def test_nothing_is_started_when_all_is_there(tmp_path):
    record(job(tmp_path), 1, stand_in(tmp_path))
    seen = []
    record(job(tmp_path), 1, "/no/such/python", lambda *counts: seen.append(counts))
    assert seen == [(7, 7)]


def test_a_data_set_can_be_enlarged(tmp_path):
    python = stand_in(tmp_path)
    record(job(tmp_path, 2), 1, python)
    info = record(job(tmp_path, 4), 1, python)
    assert info.count == 4
    assert written(tmp_path) == dict.fromkeys(range(4), 1)


@pytest.mark.parametrize(
    ("change", "named"),
    [({"seed": 2}, "seed"), ({"size": (32, 18)}, "width"), ({"views": 2}, "views")],
)
def test_a_folder_with_another_recording_is_refused(tmp_path, change, named):
    python = stand_in(tmp_path)
    record(job(tmp_path, 2), 1, python)
    options = {"seed": 1, "size": (64, 36), "views": 1} | change
    other = RecordingJob("duel", 2, output=tmp_path / "data", **options)
    with pytest.raises(EpisodeError, match=f"another recording.*{named}"):
        record(other, 1, python)


def test_a_failing_process_shows_the_end_of_its_messages_and_ends_the_others(tmp_path):
    each = "sys.exit('Blender broke') if number == 3 else time.sleep(60 if number > 3 else 0)"
    with pytest.raises(EpisodeError, match="00003 failed with status 1(?s:.*)Blender broke"):
        record(job(tmp_path), 2, stand_in(tmp_path, each))
    assert running(tmp_path) == []
    assert 3 not in written(tmp_path)


def test_a_process_that_ends_early_without_an_error_is_still_a_failure(tmp_path):
    each = "sys.exit(0) if number == 1 else None"
    with pytest.raises(EpisodeError, match="failed with status 0, 1 unfinished"):
        record(job(tmp_path, 3), 1, stand_in(tmp_path, each))


def test_a_python_without_blender_is_explained(tmp_path):
    each = "import no_blender_here"
    with pytest.raises(EpisodeError, match=r"no_blender_here.*pip install .*\[blender\]"):
        record(job(tmp_path), 1, stand_in(tmp_path, each))


def test_a_recording_where_blender_cannot_be_imported_is_explained(tmp_path, monkeypatch):
    absent = "raise ModuleNotFoundError('No module named bpy')"
    (tmp_path / "bpy.py").write_text(absent)
    monkeypatch.setenv("PYTHONPATH", os.fspath(tmp_path))
    # A checkout comes first on the path, but holds no bpy of its own.
    with pytest.raises(EpisodeError, match=r"cannot record: No module named bpy.*pip install"):
        record(job(tmp_path, 1), 1)


def test_a_python_that_does_not_exist_is_explained(tmp_path):
    with pytest.raises(EpisodeError, match="cannot start /no/such/python"):
        record(job(tmp_path), 1, "/no/such/python")


def test_cancelling_ends_all_processes_and_the_next_run_resumes(tmp_path):
    def cancel(done, total):
        if done == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        record(job(tmp_path), 2, stand_in(tmp_path, "time.sleep(60 * (number > 0))"), cancel)
    assert running(tmp_path) == []
    assert written(tmp_path) == {0: 1}
    record(job(tmp_path), 2, stand_in(tmp_path))
    assert written(tmp_path) == dict.fromkeys(range(7), 1)


def test_a_process_that_ignores_the_request_to_end_is_killed(tmp_path, monkeypatch):
    monkeypatch.setattr(recording, "_STOP_SECONDS", 0.2)
    each = "__import__('signal').signal(15, 1); time.sleep(60 * (number > 0))"

    def cancel(done, total):
        if done == 1:
            time.sleep(0.2)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        record(job(tmp_path, 4), 1, stand_in(tmp_path, each), cancel)
    assert running(tmp_path) == []


@pytest.mark.parametrize("processes", [1, 2, 8])
def test_splitting_gives_every_number_once_in_consecutive_ranges(processes):
    missing = [0, 1, 2, 5, 6, 9, *range(20, 90)]
    chunks = split(missing, processes)
    assert [number for chunk in chunks for number in chunk] == missing
    assert max(len(chunk) for chunk in chunks) <= 25


def test_splitting_leaves_each_process_several_chunks():
    assert len(split(list(range(100)), 2)) == 8
    assert split([], 4) == []
    assert split([3], 4) == [range(3, 4)]


@pytest.mark.parametrize(
    "change", [{"sequences": 0}, {"views": 0}, {"samples": 0}, {"size": (0, 36)}]
)
def test_a_job_of_nothing_is_refused(tmp_path, change):
    options = {"sequences": 1, "seed": 0, "size": (64, 36), "output": tmp_path} | change
    with pytest.raises(EpisodeError, match="expected 1 or more"):
        RecordingJob("duel", **options)


def test_a_scene_that_does_not_exist_is_refused(tmp_path):
    with pytest.raises(EpisodeError, match="nowhere.blend does not exist"):
        RecordingJob("nowhere.blend", 1, 0, (64, 36), tmp_path)


def test_a_blend_file_is_one_episode(tmp_path):
    scene = tmp_path / "scene.blend"
    scene.write_bytes(b"")
    with pytest.raises(EpisodeError, match="one episode"):
        RecordingJob(str(scene), 2, 0, (64, 36), tmp_path)


def test_the_count_on_disk_never_shrinks(tmp_path):
    info = DatasetInfo("duel", 1, 9, 5.0, 64, 36, ("a",), ("idle",), 1)
    write_dataset(tmp_path / "data", info)
    record(job(tmp_path, 2), 1, stand_in(tmp_path))
    assert read_info(tmp_path / "data").count == 9
