"""Episodes on disk: what is written is read back, and everything malformed is refused."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pe_runtime.contract import episode as contract
from pe_runtime.contract.episode import (
    DatasetInfo,
    EpisodeArrays,
    read_dataset,
    read_episode,
    read_info,
    write_dataset,
    write_depth,
    write_episode,
)
from pe_runtime.contract.errors import EpisodeError

VIEWS, FRAMES, OBJECTS = 2, 3, 2
INFO = DatasetInfo("duel", 7, 4, 5.0, 8, 6, ("player_1", "player_2"), ("idle", "left"), VIEWS)


def numbers(**changes):
    rng = np.random.default_rng(0)
    boxes = rng.uniform(0, 5, (VIEWS, FRAMES, OBJECTS, 4)).astype(np.float32)
    boxes[1, 2, 0] = np.nan
    lens = np.array([[7.0, 0, 4], [0, 7, 3], [0, 0, 1]])
    arrays = {
        "intrinsics": np.tile(lens, (VIEWS, FRAMES, 1, 1)),
        "world_from_camera": np.tile(np.eye(4), (VIEWS, FRAMES, 1, 1)),
        "boxes": boxes,
        "present": np.isfinite(boxes).all(-1),
        "positions": rng.normal(size=(FRAMES, OBJECTS, 3)),
        "actions": np.array([[0, 1], [1, -1]], dtype=np.int8),
    }
    return arrays | changes


def put_pictures(path):
    for view in range(VIEWS):
        for frame in range(FRAMES):
            picture = contract.frame_path(path, view, frame)
            picture.parent.mkdir(parents=True, exist_ok=True)
            picture.write_bytes(b"picture")


@pytest.fixture
def stored(tmp_path):
    """A data set of one complete episode; returns the episode's folder."""
    write_dataset(tmp_path, INFO)
    path = contract.episode_path(tmp_path, 0)
    put_pictures(path)
    write_episode(path, INFO, EpisodeArrays(**numbers()), {"sequence": 0})
    return path


def test_an_episode_comes_back_as_it_was_written(stored):
    found = read_episode(stored)
    assert found.info == INFO
    assert found.metadata == {"sequence": 0}
    for name, array in numbers().items():
        np.testing.assert_array_equal(getattr(found.arrays, name), array)
        assert getattr(found.arrays, name).dtype == array.dtype
    assert (found.arrays.views, found.arrays.frames) == (VIEWS, FRAMES)


def test_pictures_are_found_where_the_layout_says(stored):
    found = read_episode(stored)
    assert found.frame_path(1, 2) == stored / "frames" / "1" / "0002.png"
    assert found.mask_path(0, 1) == stored / "masks" / "0" / "0001.png"
    assert found.frame_path(1, 2).is_file()


def test_the_camera_of_a_picture_has_its_size_and_pose(stored):
    camera = read_episode(stored).camera(1, 2)
    assert (camera.width, camera.height) == (8, 6)
    np.testing.assert_array_equal(camera.world_from_camera, np.eye(4))


def test_depth_keeps_infinity_and_half_precision(stored):
    depth = np.linspace(1, 30, 48).reshape(6, 8)
    depth[0, 0] = np.inf
    write_depth(stored, 0, 1, depth)
    found = read_episode(stored).depth(0, 1)
    np.testing.assert_array_equal(found, depth.astype(np.float16))


def test_a_missing_or_wrong_depth_is_an_error(stored):
    found = read_episode(stored)
    with pytest.raises(EpisodeError, match="cannot be read"):
        found.depth(0, 0)
    write_depth(stored, 0, 0, np.ones((2, 2)))
    with pytest.raises(EpisodeError, match=r"shape \(6, 8\).*\(2, 2\)"):
        found.depth(0, 0)


def test_a_data_set_lists_its_complete_episodes_in_order(stored):
    root = stored.parent
    for number in (3, 1, 2):
        path = contract.episode_path(root, number)
        put_pictures(path)
        if number != 2:
            write_episode(path, INFO, EpisodeArrays(**numbers()), {})
    info, paths = read_dataset(root)
    assert info == INFO
    assert [path.name for path in paths] == ["00000", "00001", "00003"]


def test_an_episode_without_its_last_file_is_not_complete(stored):
    (stored / "episode.json").unlink()
    assert not contract.is_complete(stored)
    with pytest.raises(EpisodeError, match="no complete episode"):
        read_episode(stored)


def test_an_episode_with_a_picture_missing_is_never_completed(tmp_path):
    path = contract.episode_path(tmp_path, 0)
    put_pictures(path)
    contract.frame_path(path, 1, 1).unlink()
    with pytest.raises(EpisodeError, match="picture 1/0001 is missing"):
        write_episode(path, INFO, EpisodeArrays(**numbers()), {})
    assert not contract.is_complete(path)


def test_processes_that_describe_one_data_set_at_once_do_not_meet(tmp_path):
    code = (
        "import sys; sys.path.insert(0, sys.argv[2]);"
        "from pe_runtime.contract.episode import *; from pathlib import Path;"
        "info = DatasetInfo('duel', 7, 4, 5.0, 8, 6, ('a',), ('idle',), 1);"
        "[(write_dataset(Path(sys.argv[1]), info), read_info(sys.argv[1])) for _ in range(300)]"
    )
    root = os.fspath(Path(contract.__file__).parents[2])
    crew = [subprocess.Popen([sys.executable, "-c", code, tmp_path, root]) for _ in range(3)]
    assert [process.wait() for process in crew] == [0, 0, 0]
    assert [path.name for path in tmp_path.iterdir()] == ["dataset.json"]


def test_a_folder_that_is_no_data_set_is_refused(tmp_path):
    with pytest.raises(EpisodeError, match="no data set"):
        read_dataset(tmp_path)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("boxes", np.zeros((VIEWS, FRAMES, OBJECTS, 4)), "float64; expected an array of float32"),
        ("positions", np.zeros((FRAMES, 3, 3)), "positions has shape"),
        ("actions", np.zeros((FRAMES, OBJECTS), dtype=np.int8), "actions has shape"),
        ("present", np.ones((VIEWS, FRAMES), dtype=bool), r"expected \(V, T, P\)"),
        ("present", np.ones((VIEWS, FRAMES, OBJECTS), dtype=bool), "or the reverse"),
        ("positions", np.full((FRAMES, OBJECTS, 3), np.nan), "positions holds NaN"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(name, value, message):
    with pytest.raises(EpisodeError, match=message):
        EpisodeArrays(**numbers(**{name: value}))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"objects": ("player_1",)}, "2 views of 2 objects, the data set says 2 views of 1"),
        ({"views": 1}, "the data set says 1 views"),
        ({"actions": ("idle",)}, "actions run from -1 to 1"),
    ],
)
def test_arrays_of_another_data_set_are_refused(tmp_path, change, message):
    put_pictures(tmp_path)
    with pytest.raises(EpisodeError, match=message):
        write_episode(tmp_path, replace(INFO, **change), EpisodeArrays(**numbers()), {})


@pytest.mark.parametrize("value", [-np.eye(4), 2 * np.eye(4)])
def test_a_pose_that_is_not_rigid_is_refused(tmp_path, value):
    put_pictures(tmp_path)
    arrays = EpisodeArrays(**numbers(world_from_camera=np.tile(value, (VIEWS, FRAMES, 1, 1))))
    with pytest.raises(EpisodeError, match="world_from_camera"):
        write_episode(tmp_path, INFO, arrays, {})


def test_actions_below_minus_one_are_refused(tmp_path):
    put_pictures(tmp_path)
    arrays = EpisodeArrays(**numbers(actions=np.full((2, 2), -2, dtype=np.int8)))
    with pytest.raises(EpisodeError, match="actions run from -2"):
        write_episode(tmp_path, INFO, arrays, {})


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 cut off", b"no archive at all"])
def test_a_damaged_archive_is_an_error(stored, content):
    (stored / "arrays.npz").write_bytes(content)
    with pytest.raises(EpisodeError, match="arrays.npz cannot be read"):
        read_episode(stored)


def test_a_truncated_archive_is_an_error(stored):
    whole = (stored / "arrays.npz").read_bytes()
    (stored / "arrays.npz").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(EpisodeError, match="arrays.npz cannot be read"):
        read_episode(stored)


def test_an_archive_with_a_pickle_is_refused(stored):
    np.savez(stored / "arrays.npz", **numbers(boxes=np.array([{"a": 1}], dtype=object)))
    with pytest.raises(EpisodeError, match="cannot be read"):
        read_episode(stored)


def test_an_archive_with_other_arrays_is_an_error(stored):
    arrays = numbers(extra=np.zeros(1))
    np.savez(stored / "arrays.npz", **arrays)
    with pytest.raises(EpisodeError, match="'extra'"):
        read_episode(stored)


@pytest.mark.parametrize("content", ["", "[1, 2]", '{"format": 1', "\udcff"])
def test_an_unreadable_description_is_an_error(stored, content):
    data = content.encode("utf-8", "surrogateescape")
    (stored / "episode.json").write_bytes(data)
    with pytest.raises(EpisodeError, match="episode.json"):
        read_episode(stored)
    (stored.parent / "dataset.json").write_bytes(data)
    with pytest.raises(EpisodeError, match="dataset.json"):
        read_info(stored.parent)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("format", 2, "format 2 is unknown, expected 1"),
        ("width", 0, "width is 0"),
        ("width", "256", "width is '256', of the wrong type"),
        ("width", True, "width is True"),
        ("steps_per_second", 0, "a rate above 0"),
        ("objects", [1], "a list of names"),
        ("seed", None, "seed is None"),
        ("colour", 1, "colour"),
    ],
)
def test_a_wrong_fact_about_the_data_set_is_an_error(stored, key, value, message):
    file = stored.parent / "dataset.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {key: value}))
    with pytest.raises(EpisodeError, match=message):
        read_info(stored.parent)


def test_a_missing_fact_is_an_error(stored):
    file = stored / "episode.json"
    facts = json.loads(file.read_text())
    del facts["dataset"]["views"]
    file.write_text(json.dumps(facts))
    with pytest.raises(EpisodeError, match="views"):
        read_episode(stored)


def test_an_episode_may_have_a_single_frame(tmp_path):
    arrays = numbers()
    one = {name: array[:, :1] for name, array in arrays.items() if name not in {"positions"}}
    one |= {"positions": arrays["positions"][:1], "actions": np.zeros((0, OBJECTS), dtype=np.int8)}
    for view in range(VIEWS):
        picture = contract.frame_path(tmp_path, view, 0)
        picture.parent.mkdir(parents=True)
        picture.write_bytes(b"picture")
    write_episode(tmp_path, INFO, EpisodeArrays(**one), {})
    assert read_episode(tmp_path).arrays.frames == 1
