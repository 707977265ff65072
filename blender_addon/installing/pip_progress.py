"""How far pip is, from what it says and from what it has put on disk. No `bpy` here."""

import re
import time
from collections.abc import Callable
from pathlib import Path

DOWNLOADED = 0.8
"""Share of an installation after the last download; the rest is unpacking."""
PAUSE_SECONDS = 0.4
DOWNLOADING = re.compile(r"\s*Downloading (?:\S*/)?([A-Za-z0-9_.]+)-\S+ \(([^)]+)\)")
INSTALLING = "Installing collected packages: "


class PipProgress:
    """Follows one `pip install`.

    Attributes:
        stage: What pip does, in words.
        share: How much of it is done, in [0, 1].
    """

    def __init__(
        self,
        downloads: Path,
        site_packages: Callable[[], Path | None],
        expected_bytes: int,
    ) -> None:
        """Follow a pip that has yet to start.

        Args:
            downloads: pip's temporary folder, where all downloads go first.
            site_packages: Finds where packages are unpacked to; None as long as there is no such.
            expected_bytes: What will be downloaded, roughly.
        """
        self.stage, self.share = "Looking for packages", 0.0
        self._downloads, self._site_packages = downloads, site_packages
        self._expected = expected_bytes
        self._packages = 0
        self._looked = 0.0

    def note_line(self, line: str) -> None:
        """Take in what pip says."""
        if found := DOWNLOADING.match(line):
            self.stage = f"Downloading {found[1].replace('_', '-')}, {found[2]}"
        elif line.startswith(INSTALLING):
            self._packages = line.count(",") + 1
            self.stage = f"Unpacking {self._packages} packages"
            self.share = max(self.share, DOWNLOADED)

    def look(self) -> None:
        """Take in what is on disk, if the last look was a while ago."""
        if time.monotonic() - self._looked < PAUSE_SECONDS:
            return
        if self._packages:
            done = min(1.0, self._unpacked() / self._packages)
            share = DOWNLOADED + (1.0 - DOWNLOADED) * done
        else:
            share = DOWNLOADED * min(1.0, size_of(self._downloads) / self._expected)
        # A folder that pip empties between two steps is no step back.
        self.share = max(self.share, share)
        self._looked = time.monotonic()

    def _unpacked(self) -> int:
        folder = self._site_packages()
        return 0 if folder is None else len(list(folder.glob("*.dist-info")))


def size_of(folder: Path) -> int:
    """Bytes of all files below a folder that may change at any moment."""
    total = 0
    for path in folder.rglob("*"):
        try:
            total += path.stat().st_size if path.is_file() else 0
        except OSError:
            continue
    return total
