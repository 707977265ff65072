"""Files that appear at once and complete, or not at all. No `bpy` here."""

import contextlib
import uuid
from pathlib import Path


def write_complete(path: Path, content: bytes) -> None:
    """Write a file beside its place and move it there.

    Raises:
        OSError: It cannot be written; nothing is left behind.
    """
    unfinished = path.with_name(f".{uuid.uuid4().hex}.part")
    try:
        unfinished.write_bytes(content)
        unfinished.replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            unfinished.unlink()
        raise
