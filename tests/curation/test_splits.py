"""Data sets in parts: read from text, found on disk."""

import pytest
from small_dataset import write_small

from pe_runtime.contract.errors import EpisodeError
from pe_runtime.curation.splits import parse_splits, split_folders


def test_splits_are_read_from_text():
    assert parse_splits("train=80, val=8,test=16") == {"train": 80, "val": 8, "test": 16}
    assert parse_splits("test=1") == {"test": 1}


@pytest.mark.parametrize(
    "text", ["", "train", "train=", "train=0", "train=-1", "train=a", "dev=3", "val=1,val=2"]
)
def test_what_names_no_splits_is_refused(text):
    with pytest.raises(EpisodeError, match="expected a text such as train=80"):
        parse_splits(text)


def test_a_folder_is_a_data_set_or_its_splits(tmp_path):
    write_small(tmp_path / "train", episodes=1)
    write_small(tmp_path / "test", episodes=1)
    assert split_folders(tmp_path) == {name: tmp_path / name for name in ("train", "test")}
    assert split_folders(tmp_path / "train") == {"": tmp_path / "train"}


def test_a_folder_of_neither_is_an_error(tmp_path):
    with pytest.raises(EpisodeError, match=r"dataset.json is missing, here and in train, val"):
        split_folders(tmp_path)
