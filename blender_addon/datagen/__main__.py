"""Record episodes in this process: `python -m blender_addon.datagen --scene duel ...`.

Standard output carries one JSON line per finished episode; everything Blender prints is dropped.
Episodes already complete are skipped. `pe dataset record` runs several of these at once.
"""

import argparse
import json
import os
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from pe_runtime.contract.episode import (
    DATASET_FILE,
    DatasetInfo,
    episode_path,
    is_complete,
    read_info,
    write_dataset,
)
from pe_runtime.contract.errors import EpisodeError, PlayableEnvironmentError
from pe_runtime.contract.scenes import BUILT_IN_SCENES

if TYPE_CHECKING:
    from blender_addon.datagen.recordable import Recordable

NO_BLENDER = 3  # exit status that pe_runtime.recording explains


def main(arguments: list[str] | None = None) -> int:
    """Record a range of sequences; returns the exit status."""
    options = _parse(arguments)
    try:
        replies = _keep_stdout_clean()
        _record(options, replies)
    except ModuleNotFoundError as error:
        sys.stderr.write(f"{error}: recording runs in Blender's Python\n")
        return NO_BLENDER
    except PlayableEnvironmentError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    return 0


def _parse(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m blender_addon.datagen", description=__doc__)
    parser.add_argument("--scene", default="duel", help="a built-in scene, or a .blend file")
    parser.add_argument("--sequence-range", nargs=2, type=int, metavar=("A", "B"), default=(0, 1))
    parser.add_argument("--count", type=int, help="episodes of the whole data set (default: B)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--size", type=_size, default=(256, 144), metavar="WxH")
    parser.add_argument("--views", type=int, default=1)
    parser.add_argument("--samples", type=int, default=1, help="Cycles samples per ray")
    parser.add_argument(
        "--frames", type=int, help="frames of an episode (default: 12, or the file's)"
    )
    parser.add_argument("-o", "--output", type=Path, required=True)
    return parser.parse_args(arguments)


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if not (width.isdigit() and height.isdigit() and int(width) and int(height)):
        raise argparse.ArgumentTypeError(f"{text!r} is not a size; write it like 256x144")
    return int(width), int(height)


def _record(options: argparse.Namespace, replies: TextIO) -> None:
    from blender_addon.datagen.recorder import Recording, dataset_info, record_episode

    recording = Recording(*options.size, options.views, options.samples)
    build = _scene_builder(options)
    first, end = options.sequence_range
    for number in range(first, end):
        path = episode_path(options.output, number)
        if not is_complete(path):
            source = build(number)
            info = dataset_info(source, recording, options.seed, options.count or end)
            _join_dataset(options.output, info)
            metadata = {"sequence": number, "seed": options.seed, "samples": options.samples}
            record_episode(source, recording, info, path, metadata)
        replies.write(json.dumps({"episode": number}) + "\n")
        replies.flush()


def _join_dataset(root: Path, info: DatasetInfo) -> None:
    """Found the data set, or make sure that it is the same one but for its count."""
    if not (root / DATASET_FILE).is_file():
        write_dataset(root, info)
        return
    found = read_info(root)
    if replace(found, count=info.count) != info:
        raise EpisodeError(
            f"{root} holds another recording: {found} instead of {info}; choose another folder, "
            "or record with the same options"
        )


def _scene_builder(options: argparse.Namespace) -> "Callable[[int], Recordable]":
    from blender_addon.datagen.recordable import keep_first_frames, open_blend

    def build(number: int) -> "Recordable":
        if options.scene in BUILT_IN_SCENES:
            from blender_addon.datagen.built_in import build_scene

            return build_scene(options.scene, options.seed, number, options.frames)
        source = open_blend(Path(options.scene))
        if options.frames is not None:
            keep_first_frames(source, options.frames)
        return source

    return build


def _keep_stdout_clean() -> TextIO:
    """Point file descriptor 1 at nothing (Blender writes there) and return the real one."""
    sys.stdout.flush()
    replies = os.fdopen(os.dup(1), "w", encoding="utf-8")
    with Path(os.devnull).open("w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    return replies


if __name__ == "__main__":
    sys.exit(main())
