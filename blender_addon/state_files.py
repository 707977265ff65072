"""Encoded states as files named after their content, for a worker to read.

A .blend keeps each state as a text block; its file can be lost at any time and is written again.
Shots in text blocks name such files without their folder, so that they hold on every machine.
"""

import dataclasses
import hashlib
import json
import os
import re
import tempfile
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path, PurePath

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.shot import Shot, Start

from .complete_files import write_complete

FOLDER = "playable_environments"
_CONTENT_NAME = re.compile(r"[0-9a-f]{64}\.json")


def state_file(text: str) -> Path:
    """The file of a state, written if it is not there already; whole or not at all.

    Args:
        text: The state's JSON; the same text always gives the same name.

    Raises:
        ShotError: The folder for temporary files takes no file.
    """
    content, name, problems = text.encode(), file_name(text), []
    try:
        for folder in _folders():
            path = folder / name
            if _holds(path, content):
                return path
            try:
                folder.mkdir(mode=0o700, exist_ok=True)
                write_complete(path, content)
                return path
            except OSError as error:
                # Another Blender may have been faster, and hold it open.
                if _holds(path, content):
                    return path
                problems.append(error)
    except OSError as error:
        problems.append(error)
    raise ShotError(
        f"cannot keep an encoded state in the folder for temporary files ({problems[0]}); free "
        "some space there, or set TMPDIR to a folder that can be written and start Blender again"
    ) from problems[0]


def file_name(text: str) -> str:
    """What the file of a state is called."""
    return f"{hashlib.sha256(text.encode()).hexdigest()}.json"


@lru_cache(maxsize=32)
def stored_state(content: str, where: str) -> str:
    """The state inside the text of an encoded picture, as `state_file` takes it.

    Args:
        content: JSON with the key "state".
        where: The text block's name, for errors.

    Raises:
        ShotError: There is no state in it.
    """
    try:
        state = json.loads(content)["state"]
        if not isinstance(state["objects"], dict):
            raise TypeError("its objects are no table")
    except (ValueError, TypeError, KeyError) as error:
        raise ShotError(
            f"{where!r} is no environment ({error!r}); make a new one from the picture"
        ) from error
    return json.dumps(state)


@lru_cache(maxsize=32)
def picture_in(content: str, where: str) -> Start:
    """The picture, camera and boxes inside the text of an encoded picture.

    Args:
        content: JSON with the key "start".
        where: The text block's name, for errors.

    Raises:
        ShotError: There is none in it.
    """
    try:
        start = json.loads(content)["start"]
        camera = Camera.from_dict(start["camera"], f"{where}: camera")
        boxes = {name: tuple(box) for name, box in start["boxes"].items()}
        return Start(image=start["image"], camera=camera, boxes=boxes)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ShotError(
            f"{where!r} is no environment ({error!r}); make a new one from the picture"
        ) from error


def portable(shot: Shot) -> Shot:
    """The shot with its state files by name alone, the same in every temporary folder."""
    return with_files(shot, lambda path: PurePath(path).name if is_content_name(path) else path)


def is_content_name(path: str) -> bool:
    """Whether a path's last part is the name of a state file of ours."""
    return _CONTENT_NAME.fullmatch(PurePath(path).name) is not None


def with_files(shot: Shot, place: Callable[[str], str]) -> Shot:
    """The shot with every state file that it names put elsewhere."""
    start = shot.start
    if start.state is not None:
        start = dataclasses.replace(start, state=place(start.state))
    tracks = tuple(
        dataclasses.replace(
            track,
            styles=tuple(
                mix if mix.image is None else dataclasses.replace(mix, image=place(mix.image))
                for mix in track.styles
            ),
        )
        for track in shot.objects
    )
    return dataclasses.replace(shot, start=start, objects=tracks)


def _folders() -> Iterator[Path]:
    """Where states may lie: one folder for all, and one's own where that is somebody else's."""
    temporary = Path(tempfile.gettempdir())
    yield temporary / FOLDER
    if hasattr(os, "getuid"):
        yield temporary / f"{FOLDER}_{os.getuid()}"


def _holds(path: Path, content: bytes) -> bool:
    try:
        return path.read_bytes() == content
    except OSError:
        return False
