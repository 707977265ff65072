"""Which frames have to be drawn, and which are on disk as the scene wants them. No `bpy` here."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.model_facts import ModelFacts
from pe_runtime.contract.shot import Shot

from ..filming.frame_origin import frame_origin
from ..worker import questions
from ..worker.session import session
from ..worker.worker_client import OnProgress, ShouldStop
from .job import RangeJob
from .manifest import FILE_NAME, FrameNote, Manifest, read_manifest
from .whole_files import FileFacts, facts_of


@dataclass(frozen=True)
class Wish:
    """What a scene asks of a job.

    Attributes:
        job: The frames and their folder.
        whole: The baked shot that is predicted.
        takes: Per frame the shot of that frame alone.
        settings: Text of everything beside the takes that decides the files' bytes.
        size: Width and height of the files, pixels.
        unknowable: Why nobody can tell whether a frame has changed; empty where one can.
        everything: Draw frames too that are there already.
        overwrite: Replace files too that this job has not written.
    """

    job: RangeJob
    whole: Shot
    takes: Sequence[Shot]
    settings: str
    size: tuple[int, int]
    unknowable: str = ""
    everything: bool = False
    overwrite: bool = False


@dataclass(frozen=True)
class Plan:
    """What a job does.

    Attributes:
        drawn: Frames to draw, in order.
        digests: Per frame the digest of everything that decides its file.
        size: Width and height of the files, pixels.
        facts: The model that draws.
        warnings: What the artist should know.
    """

    drawn: tuple[int, ...]
    digests: Mapping[int, str]
    size: tuple[int, int]
    facts: ModelFacts
    warnings: tuple[str, ...] = field(default=())


class ForeignFilesError(ShotError):
    """Files that the job has not written stand where its frames belong.

    Attributes:
        count: How many.
    """

    def __init__(self, foreign: Sequence[Path]) -> None:
        self.count = len(foreign)
        super().__init__(
            f"{len(foreign)} of the files were not written by this job or were changed since, "
            f"first {foreign[0]}; choose another frames folder, or allow overwriting"
        )


def plan_job(wish: Wish, should_stop: ShouldStop, on_progress: OnProgress) -> Plan:
    """Compare what the scene asks for with what is on disk; talks to the worker, so it takes time.

    Raises:
        ForeignFilesError: Files would be lost that this job has not written.
        WorkerError: The worker fails, for example because the model is missing.
    """
    on_progress("Asking the worker", 0, len(wish.takes))
    facts = session.facts(wish.whole.model, should_stop)
    digests = {} if wish.unknowable else _asked_digests(wish, facts, should_stop, on_progress)
    manifest = read_manifest(wish.job.folder)
    drawn, foreign = [], []
    for done, frame in enumerate(wish.job.frames):
        on_progress("Comparing", done, len(wish.job.frames))
        path, note = wish.job.file(frame), manifest.frames.get(frame)
        found = facts_of(path.read_bytes()) if path.is_file() else None
        if found is not None and not _is_ours(found, note, wish.job.id):
            foreign.append(path)
        elif not wish.everything and _shows(found, note, digests.get(frame, "")):
            continue
        drawn.append(frame)
    if foreign and not wish.overwrite:
        raise ForeignFilesError(foreign)
    return Plan(tuple(drawn), digests, wish.size, facts, _warnings(wish, manifest))


def foreign_files(job: RangeJob) -> list[Path]:
    """Files in the job's way that it has not written, found without reading them."""
    notes = read_manifest(job.folder).frames
    ours = {frame for frame, note in notes.items() if note.job == job.id}
    return [job.file(n) for n in job.frames if n not in ours and job.file(n).exists()]


def _asked_digests(
    wish: Wish, facts: ModelFacts, should_stop: ShouldStop, on_progress: OnProgress
) -> dict[int, str]:
    found: dict[int, str] = {}
    for take in wish.takes:
        asked = questions.digests(session, take, wish.whole, should_stop)
        # What else a file says: an action begins in a frame that it does not change yet.
        origin = json.dumps(frame_origin(take, wish.whole, facts))
        found |= {n: _sealed(digest, origin, wish.settings) for n, digest in asked.items()}
        on_progress("Asking the worker", len(found), len(wish.takes))
    return found


def _sealed(*parts: str) -> str:
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _is_ours(found: FileFacts, note: FrameNote | None, job: str) -> bool:
    return note is not None and note.job == job and note.file in (None, found)


def _shows(found: FileFacts | None, note: FrameNote | None, digest: str) -> bool:
    """Whether a file is the very one that would be drawn."""
    if found is None or note is None or not digest:
        return False
    return note.digest == digest and note.file == found


def _warnings(wish: Wish, manifest: Manifest) -> tuple[str, ...]:
    said = []
    if manifest.warning:
        said.append(f"{manifest.warning}; it is kept as {FILE_NAME}.unreadable")
    if wish.unknowable:
        said.append(f"{wish.unknowable}, so all frames are rendered")
    return tuple(said)
