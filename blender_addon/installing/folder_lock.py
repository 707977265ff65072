"""One at a time in a folder, also among several Blenders; a lock dies with its process."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

if sys.platform == "win32":
    import msvcrt

    def _take(file: BinaryIO) -> None:
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def _take(file: BinaryIO) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


LOCK = "set-up.lock"


class FolderBusyError(OSError):
    """Somebody else works in the folder."""


@contextmanager
def folder_lock(folder: Path) -> Iterator[None]:
    """Be the only one who works in a folder, which is made if need be.

    Raises:
        FolderBusyError: Somebody else does.
        OSError: The folder cannot be written to.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / LOCK).open("wb") as file:
        try:
            _take(file)
        except OSError as error:
            raise FolderBusyError(f"another Blender works in {folder}") from error
        yield
