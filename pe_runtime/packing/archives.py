"""Zip files whose bytes depend on their contents alone: equal sources, equal file."""

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path

Contents = Mapping[str, bytes]
"""Path in an archive, parts divided by `/`, to the bytes of the file."""

PLAIN_FILE = 0o100644 << 16
"""An ordinary file that everyone may read, as archives of Unix note it."""


def zip_bytes(contents: Contents) -> bytes:
    """The archive of these files, in the order of their names and all of one date."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        for name in sorted(contents):
            entry = zipfile.ZipInfo(name)
            entry.external_attr = PLAIN_FILE
            # Stated, since it would tell on which system the archive was made.
            entry.create_system = 3
            archive.writestr(entry, contents[name], zipfile.ZIP_DEFLATED)
    return made.getvalue()


def read_tree(folder: Path, left_out: frozenset[str] = frozenset()) -> dict[str, bytes]:
    """All files below a folder by their path within it.

    Args:
        folder: Where to look.
        left_out: Names of files and folders that do not count. Byte code never does.
    """
    files = {}
    for path in sorted(each for each in folder.rglob("*") if each.is_file()):
        parts = path.relative_to(folder).parts
        if not {*parts} & (left_out | {"__pycache__"}) and path.suffix != ".pyc":
            files["/".join(parts)] = path.read_bytes()
    return files
