"""A copy of a data set with smaller pictures, for quick comparisons of many trainings."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from pe_runtime.contract.episode import (
    DATASET_FILE,
    DatasetInfo,
    Episode,
    EpisodeArrays,
    depth_path,
    frame_path,
    is_complete,
    mask_path,
    read_dataset,
    read_episode,
    read_info,
    write_dataset,
    write_depth,
    write_episode,
)
from pe_runtime.contract.errors import EpisodeError
from pe_runtime.images import read_image, write_png

Progress = Callable[[int, int], None]


def shrink_dataset(
    source: Path,
    output: Path,
    factor: int,
    on_progress: Progress = lambda done, total: None,
) -> DatasetInfo:
    """Write a data set like `source` whose pictures have 1/factor of the width and the height.

    A pixel becomes the mean of the pixels that it covers; masks and depths, of which there is no
    mean, take the middle one. Cameras and boxes are scaled. Episodes that the copy already has are
    kept, so it may be interrupted.

    Args:
        source: A data set.
        output: Folder of the copy.
        factor: Pixels that become one, along each side; 2 or more.
        on_progress: Called with the episodes written and their number.

    Raises:
        EpisodeError: The factor does not divide the size, or `output` holds another data set.
    """
    info, folders = read_dataset(source)
    if factor < 2 or info.width % factor or info.height % factor:
        raise EpisodeError(
            f"pictures of {info.width}x{info.height} cannot be shrunk by {factor}; expected a "
            "whole number from 2 that divides both"
        )
    small = replace(info, width=info.width // factor, height=info.height // factor)
    if (output / DATASET_FILE).is_file() and replace(read_info(output), count=small.count) != small:
        raise EpisodeError(f"{output} holds another data set; choose another folder for the copy")
    write_dataset(output, small)
    for done, folder in enumerate(folders, start=1):
        if not is_complete(output / folder.name):
            _shrink_episode(read_episode(folder), output / folder.name, small, factor)
        on_progress(done, len(folders))
    return small


def shrunk_arrays(arrays: EpisodeArrays, factor: int) -> EpisodeArrays:
    """The numbers of an episode for pictures of 1/factor of the size.

    Pixels are counted from corners, so K scales as a whole but for its last row, and boxes do.
    """
    intrinsics = arrays.intrinsics.copy()
    intrinsics[..., :2, :] /= factor
    return replace(arrays, intrinsics=intrinsics, boxes=(arrays.boxes / factor).astype(np.float32))


def _shrink_episode(episode: Episode, copy: Path, info: DatasetInfo, factor: int) -> None:
    if copy.exists():  # left by an interrupted run
        shutil.rmtree(copy)
    size, middle = (info.width, info.height), slice(factor // 2, None, factor)
    for view in range(episode.arrays.views):
        for frame in range(episode.arrays.frames):
            picture = read_image(episode.frame_path(view, frame))
            small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
            target = frame_path(copy, view, frame)
            target.parent.mkdir(parents=True, exist_ok=True)
            write_png(target, small)
            masks = episode.mask_path(view, frame)
            if masks.is_file():
                ids = cv2.imread(str(masks), cv2.IMREAD_UNCHANGED)[middle, middle]
                mask_path(copy, view, frame).parent.mkdir(parents=True, exist_ok=True)
                cv2.imwrite(str(mask_path(copy, view, frame)), ids)
            if depth_path(episode.path, view, frame).is_file():
                write_depth(copy, view, frame, episode.depth(view, frame)[middle, middle])
    arrays = shrunk_arrays(episode.arrays, factor)
    write_episode(copy, info, arrays, {**episode.metadata, "shrunk": factor})
