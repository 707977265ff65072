"""A copy of a data set whose cameras and boxes are noisy; the pictures are the same files.

Every episode of the copy keeps its true annotations beside the noisy ones:

    COPY/00000/arrays.npz        noisy cameras and boxes of the first view
    COPY/00000/true_arrays.npz   what was recorded
    COPY/00000/episode.json      `metadata.noise` says what was done, `metadata.noise_seed` how
"""

import os
import shutil
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from pe_runtime.contract.episode import (
    ARRAYS_FILE,
    DATASET_FILE,
    DatasetInfo,
    Episode,
    EpisodeArrays,
    is_complete,
    read_dataset,
    read_episode,
    read_info,
    write_dataset,
    write_episode,
)
from pe_runtime.contract.errors import EpisodeError
from pe_runtime.curation.noise import Noise, disturbed

TRUE_ARRAYS_FILE = "true_arrays.npz"
Progress = Callable[[int, int], None]

_PICTURES = ("frames", "masks", "depth")


def disturb_dataset(
    source: Path,
    output: Path,
    noise: Noise,
    seed: int = 0,
    on_progress: Progress = lambda done, total: None,
) -> DatasetInfo:
    """Write a data set like `source` with noise on its annotations.

    Episodes that the copy already has are kept, so it may be interrupted.

    Args:
        source: A data set with true annotations.
        output: Folder of the copy.
        noise: How much is wrong.
        seed: With the source's own seed and the episode's number it decides the noise.
        on_progress: Called with the episodes written and their number.

    Raises:
        EpisodeError: If `source` is no data set or disturbed itself, or `output` holds another.
    """
    info, folders = read_dataset(source)
    _join_copy(source, output, info)
    for done, folder in enumerate(folders, start=1):
        copy = output / folder.name
        facts = {"noise": asdict(noise), "noise_seed": seed}
        if is_complete(copy):
            _check_same_noise(copy, facts)
        else:
            _disturb_episode(read_episode(folder), copy, noise, facts)
        on_progress(done, len(folders))
    return info


def undisturbed(episode: Episode) -> Episode:
    """The episode with its true annotations: itself, unless it was disturbed.

    Raises:
        EpisodeError: If the true annotations of a disturbed episode are lost or damaged.
    """
    if "noise" not in episode.metadata:
        return episode
    path = episode.path / TRUE_ARRAYS_FILE
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            arrays = EpisodeArrays(**{name: stored[name] for name in stored.files})
    except (OSError, ValueError, TypeError) as error:
        raise EpisodeError(f"{path} cannot be read: {error}; disturb the episode again") from error
    return replace(episode, arrays=arrays)


def _join_copy(source: Path, output: Path, info: DatasetInfo) -> None:
    if source.resolve() == output.resolve():
        raise EpisodeError(f"{output} is the data set itself; give another folder for the copy")
    if (output / DATASET_FILE).is_file() and replace(read_info(output), count=0) != replace(
        info, count=0
    ):
        raise EpisodeError(f"{output} holds another data set; choose another folder for the copy")
    write_dataset(output, info)


def _check_same_noise(copy: Path, facts: dict) -> None:
    found = read_episode(copy).metadata
    if {key: found.get(key) for key in facts} != facts:
        raise EpisodeError(
            f"{copy} was written with noise {found.get('noise')} and seed "
            f"{found.get('noise_seed')}; choose another folder, or give the same options"
        )


def _disturb_episode(episode: Episode, copy: Path, noise: Noise, facts: dict) -> None:
    if "noise" in episode.metadata:
        raise EpisodeError(f"{episode.path} is disturbed already; give the data set it came from")
    if copy.exists():  # left by an interrupted run
        shutil.rmtree(copy)
    for kind in _PICTURES:
        if (episode.path / kind).is_dir():
            shutil.copytree(episode.path / kind, copy / kind, copy_function=_link)
    _link(episode.path / ARRAYS_FILE, copy / TRUE_ARRAYS_FILE)
    info, number = episode.info, int(episode.path.name)
    # Splits of one data set differ in their seed, and so in their noise.
    seed = (facts["noise_seed"], info.seed, number)
    arrays = disturbed(episode.arrays, noise, (info.width, info.height), seed)
    write_episode(copy, info, arrays, {**episode.metadata, **facts})


def _link(source: str | Path, target: str | Path) -> None:
    """One more name for a file where the disk allows it, else a copy."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)
