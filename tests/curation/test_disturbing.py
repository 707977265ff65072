"""Noisy copies of data sets: the same pictures, other annotations, and the truth not lost."""

import numpy as np
import pytest
from small_dataset import FRAMES, write_small

from pe_runtime.contract.episode import read_dataset, read_episode
from pe_runtime.contract.errors import EpisodeError
from pe_runtime.curation import disturbing
from pe_runtime.curation.disturbing import disturb_dataset, undisturbed
from pe_runtime.curation.noise import Noise


@pytest.fixture
def clean(tmp_path):
    return write_small(tmp_path / "clean")


@pytest.fixture
def copy(clean, tmp_path):
    disturb_dataset(clean, tmp_path / "noisy", Noise())
    return tmp_path / "noisy"


def episodes(root):
    info, folders = read_dataset(root)
    return info, [read_episode(folder) for folder in folders]


def test_a_copy_has_the_same_pictures_and_other_annotations(clean, copy):
    info, true = episodes(clean)
    other, noisy = episodes(copy)
    assert other == info
    assert len(noisy) == 2
    for before, after in zip(true, noisy, strict=True):
        for frame in range(FRAMES):
            for place in ("frame_path", "mask_path"):
                assert getattr(after, place)(0, frame).samefile(getattr(before, place)(0, frame))
            np.testing.assert_array_equal(after.depth(0, frame), before.depth(0, frame))
        assert not np.array_equal(after.arrays.boxes, before.arrays.boxes, equal_nan=True)
        assert not np.array_equal(after.arrays.world_from_camera, before.arrays.world_from_camera)


def test_the_copy_says_what_was_done_and_keeps_what_else_was_known(copy):
    _, (first, _) = episodes(copy)
    assert first.metadata["noise"]["camera_degrees"] == Noise().camera_degrees
    assert first.metadata["noise_seed"] == 0
    assert first.metadata["sequence"] == 0


def test_the_true_annotations_are_found_again(clean, copy):
    for before, after in zip(episodes(clean)[1], episodes(copy)[1], strict=True):
        found = undisturbed(after)
        np.testing.assert_array_equal(found.arrays.boxes, before.arrays.boxes)
        np.testing.assert_array_equal(found.arrays.intrinsics, before.arrays.intrinsics)
        assert undisturbed(before) is before


def test_lost_true_annotations_are_an_error(copy):
    _, (first, _) = episodes(copy)
    (first.path / "true_arrays.npz").unlink()
    with pytest.raises(EpisodeError, match="true_arrays.npz cannot be read"):
        undisturbed(first)


def test_the_same_seed_gives_the_same_copy_and_episodes_differ(clean, copy, tmp_path):
    disturb_dataset(clean, tmp_path / "again", Noise())
    disturb_dataset(clean, tmp_path / "other", Noise(), seed=1)
    first, again, other = (
        episodes(root)[1] for root in (copy, *[tmp_path / n for n in ("again", "other")])
    )
    np.testing.assert_array_equal(again[0].arrays.boxes, first[0].arrays.boxes)
    poses = [each.arrays.world_from_camera for each in (*first, *other)]
    assert all(not np.array_equal(a, b) for k, a in enumerate(poses) for b in poses[:k])


def test_splits_of_one_data_set_get_different_noise(clean, copy, tmp_path):
    write_small(tmp_path / "val", seed=8)
    disturb_dataset(tmp_path / "val", tmp_path / "noisy_val", Noise())
    poses = [
        episodes(root)[1][0].arrays.world_from_camera for root in (copy, tmp_path / "noisy_val")
    ]
    assert not np.array_equal(*poses)


def test_an_interrupted_copy_is_completed_and_complete_episodes_are_kept(clean, copy):
    kept, half = copy / "00000" / "arrays.npz", copy / "00001"
    before = kept.stat().st_mtime_ns
    whole = (half / "arrays.npz").read_bytes()
    (half / "episode.json").unlink()
    (half / "arrays.npz").write_bytes(b"half")
    seen = []
    disturb_dataset(copy.parent / "clean", copy, Noise(), on_progress=lambda *n: seen.append(n))
    assert kept.stat().st_mtime_ns == before
    assert (half / "arrays.npz").read_bytes() == whole
    assert seen == [(1, 2), (2, 2)]


def test_files_are_copied_where_the_disk_knows_no_links(clean, tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError("no links here")

    monkeypatch.setattr(disturbing.os, "link", refuse)
    disturb_dataset(clean, tmp_path / "noisy", Noise())
    _, (first, _) = episodes(tmp_path / "noisy")
    path = first.frame_path(0, 0)
    true = clean / path.relative_to(tmp_path / "noisy")
    assert not path.samefile(true)
    assert path.read_bytes() == true.read_bytes()


def test_a_copy_with_other_noise_is_not_touched(clean, copy):
    with pytest.raises(EpisodeError, match="was written with noise"):
        disturb_dataset(clean, copy, Noise(dropout=0.5))
    with pytest.raises(EpisodeError, match="and seed 0"):
        disturb_dataset(clean, copy, Noise(), seed=4)


def test_another_data_set_in_the_folder_is_not_touched(clean, tmp_path):
    write_small(tmp_path / "other", seed=9)
    with pytest.raises(EpisodeError, match="holds another data set"):
        disturb_dataset(clean, tmp_path / "other", Noise())


def test_noise_upon_noise_and_a_data_set_upon_itself_are_refused(clean, copy, tmp_path):
    with pytest.raises(EpisodeError, match="disturbed already"):
        disturb_dataset(copy, tmp_path / "twice", Noise())
    with pytest.raises(EpisodeError, match="is the data set itself"):
        disturb_dataset(clean, clean, Noise())
