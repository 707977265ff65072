"""Data sets that come in parts: FOLDER/train, FOLDER/val, FOLDER/test, each a data set."""

from pathlib import Path

from pe_runtime.contract.episode import DATASET_FILE
from pe_runtime.contract.errors import EpisodeError

SPLITS = ("train", "val", "test")
SEED_OFFSETS = {"train": 1, "val": 2, "test": 3}
"""A split is recorded with the data set's seed plus this."""


def parse_splits(text: str) -> dict[str, int]:
    """Numbers of sequences from a text such as `train=80,val=8,test=16`.

    Raises:
        EpisodeError: If it names no split, an unknown one, one twice, or no number above 0.
    """
    found: dict[str, int] = {}
    for part in text.split(","):
        name, _, count = (word.strip() for word in part.partition("="))
        if name not in SPLITS or name in found or not count.isdecimal() or not int(count):
            raise EpisodeError(
                f"splits: expected a text such as train=80,val=8,test=16, found {text!r}"
            )
        found[name] = int(count)
    return found


def split_folders(root: str | Path) -> dict[str, Path]:
    """The data sets in a folder by name: its splits, or "" for the folder itself.

    Raises:
        EpisodeError: If the folder is neither a data set nor holds splits.
    """
    root = Path(root)
    if (root / DATASET_FILE).is_file():
        return {"": root}
    found = {name: root / name for name in SPLITS if (root / name / DATASET_FILE).is_file()}
    if not found:
        raise EpisodeError(
            f"{root} is no data set: {DATASET_FILE} is missing, here and in {', '.join(SPLITS)}; "
            "give its folder"
        )
    return found
