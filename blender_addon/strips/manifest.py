"""What is known of the frames in a folder: a small JSON file beside them. No `bpy` here.

A frame that is about to be drawn is noted without a digest first: should Blender be killed then,
the file is known to be ours and is drawn again. Several processes may fill one folder, each with
its part of a range: whoever writes takes a lock, reads, adds its own frames and replaces the file.
"""

import json
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from pe_runtime.contract.errors import ShotError

from ..complete_files import write_complete
from .whole_files import FileFacts

FILE_NAME = "playable_job.json"
SCHEMA = 1
LOCK_NAME = ".playable_job.lock"
LOCK_SECONDS = 10.0
"""A lock that is older was left by a process that died."""


@dataclass(frozen=True)
class FrameNote:
    """What is known of one frame's file.

    Attributes:
        job: The job that wrote it.
        digest: Over everything that decides its pixels; empty where that is not known.
        file: What the file is known again by; None while it is being drawn.
    """

    job: str
    digest: str = ""
    file: FileFacts | None = None


@dataclass(frozen=True)
class Manifest:
    """The notes on a folder's frames.

    Attributes:
        frames: Notes by frame number.
        warning: Why the file could not be read; empty where it could, or where there is none.
    """

    frames: Mapping[int, FrameNote] = field(default_factory=dict)
    warning: str = ""


def read_manifest(folder: Path) -> Manifest:
    """The notes in a folder; none and a warning where the file is damaged or not ours."""
    path = folder / FILE_NAME
    try:
        content = json.loads(path.read_bytes())
        if content["schema"] != SCHEMA:
            raise ValueError(f"its schema is {content['schema']!r}, this version reads {SCHEMA}")
        return Manifest({int(frame): _note(each) for frame, each in content["frames"].items()})
    except FileNotFoundError:
        return Manifest()
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        return Manifest(
            warning=f"{path} cannot be read ({error}), so nothing is known of the frames beside it"
        )


def note_frames(folder: Path, notes: Mapping[int, FrameNote]) -> None:
    """Add notes to a folder's, all or none of them.

    A file that cannot be read is kept under another name.

    Raises:
        ShotError: The folder cannot be written, or another process does not let go of the file.
    """
    path = folder / FILE_NAME
    try:
        with _locked(folder):
            known = read_manifest(folder)
            if known.warning:
                path.replace(path.with_suffix(".json.unreadable"))
            frames = dict(sorted((dict(known.frames) | dict(notes)).items()))
            content = {"schema": SCHEMA, "frames": {n: _as_json(e) for n, e in frames.items()}}
            write_complete(path, json.dumps(content, indent=0).encode())
    except OSError as error:
        raise ShotError(
            f"cannot write {path} ({error}); free some space or choose another frames folder"
        ) from error


def _note(content: Mapping) -> FrameNote:
    size, crc = content.get("size"), content.get("crc")
    facts = None if size is None else FileFacts(int(size), int(crc))
    return FrameNote(str(content["job"]), str(content["digest"]), facts)


def _as_json(note: FrameNote) -> dict:
    facts = {} if note.file is None else {"size": note.file.size, "crc": note.file.crc}
    return {"job": note.job, "digest": note.digest, **facts}


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    lock, deadline = folder / LOCK_NAME, time.monotonic() + 3 * LOCK_SECONDS
    while True:
        try:
            os.close(os.open(lock, os.O_CREAT | os.O_EXCL | os.O_WRONLY))
            break
        except FileExistsError:
            _break_if_left(lock)
            if time.monotonic() > deadline:
                raise ShotError(f"another process holds {lock}; delete it if none runs") from None
            time.sleep(0.02)
    try:
        yield
    finally:
        lock.unlink(missing_ok=True)


def _break_if_left(lock: Path) -> None:
    with suppress(FileNotFoundError):
        if time.time() - lock.stat().st_mtime > LOCK_SECONDS:
            lock.unlink()
