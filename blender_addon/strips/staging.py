"""The folder in which Blender writes, so that the frames folder only ever holds whole files.

It stands beside the frames folder, so that a finished file is moved by a rename. One that a killed
Blender left is cleared away by the next job. No `bpy` here.
"""

import os
import shutil
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pe_runtime.contract.errors import ShotError

MARK = ".rendering-"
DAY = 24 * 3600.0


@contextmanager
def staging_folder(folder: Path) -> Iterator[Path]:
    """An empty folder beside the frames folder, which is made too; gone after the block.

    Raises:
        ShotError: Neither place can be written.
    """
    staged = _make(folder)
    try:
        yield staged
    finally:
        shutil.rmtree(staged, ignore_errors=True)


def _make(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _clear_abandoned(folder)
        return _first_possible(folder)
    except OSError as error:
        raise ShotError(
            f"cannot write in the frames folder {folder} ({error}); choose another folder or "
            "change its permissions"
        ) from error


def _first_possible(folder: Path) -> Path:
    name = f"{MARK}{socket.gethostname()}-{os.getpid()}"
    # Asked first: a folder whose files cannot be replaced must not cost a whole rendering.
    probe = folder / f".{folder.name}{name}"
    probe.mkdir(exist_ok=True)
    beside = folder.parent / f".{folder.name}{name}"
    # On another disk, or where the parent is not ours to write, a rename needs a place inside.
    with suppress(OSError):
        if folder.stat().st_dev == folder.parent.stat().st_dev:
            beside.mkdir(exist_ok=True)
            probe.rmdir()
            return beside
    return probe


def _clear_abandoned(folder: Path) -> None:
    for place in (folder.parent, folder):
        for each in place.glob(f".{folder.name}{MARK}*"):
            if _is_abandoned(each):
                shutil.rmtree(each, ignore_errors=True)


def _is_abandoned(staged: Path) -> bool:
    host, _, number = staged.name.partition(MARK)[2].rpartition("-")
    try:
        age = time.time() - staged.stat().st_mtime
    except OSError:
        return False
    ours = host == socket.gethostname() and number.isdigit()
    # On Windows asking for a process by its number could end it.
    if not ours or os.name == "nt":
        return age > DAY
    return int(number) == os.getpid() or not _runs(int(number))


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
