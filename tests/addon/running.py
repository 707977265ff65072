"""Programs that run now, as Linux lists them; elsewhere nothing is listed and nothing asserted."""

import os
from pathlib import Path


def commands():
    """Process number and command of every program that has not ended."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            words = (folder / "cmdline").read_bytes().decode("utf-8", "replace").split("\0")
            state = (folder / "stat").read_text().rpartition(")")[2].split()
        except OSError:  # it ended while we looked
            continue
        if state[0] not in "ZX":
            found[int(folder.name)] = (int(state[1]), " ".join(words).strip())
    return found


def children():
    """Commands of the programs that this one started."""
    return sorted(command for parent, command in commands().values() if parent == os.getpid())


def mentioning(text):
    """Commands with this text in them."""
    return sorted(command for _, command in commands().values() if text in command)
