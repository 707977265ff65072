"""Each frame that Blender has saved is checked and put in its place, at once.

Blender calls the handlers off the main thread, so they touch files and numbers and no Blender data.
"""

import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

import bpy

from pe_runtime.contract.errors import PlayableEnvironmentError

from ..filming.range_stop import stop_reasons
from .job import RangeJob, file_name
from .manifest import FrameNote, note_frames
from .plan import Plan
from .whole_files import check_png, facts_of

NOTE_SECONDS = 1.0
"""How often the notes are written; what is not in them yet is drawn again after a crash."""


class Arrivals:
    """Watches Blender's render job of a plan, frame by frame.

    Attributes:
        placed: Frames that are in place, in order.
        ended: Whether Blender's job is over.
        cancelled: Whether it ended early.
        fault: Why a frame could not be put in its place; empty while all is well.
    """

    def __init__(self, job: RangeJob, plan: Plan, staged: Path) -> None:
        self.placed: list[int] = []
        self.ended, self.cancelled, self.fault = False, False, ""
        self._job, self._plan, self._staged = job, plan, staged
        self._waiting = deque(plan.drawn)
        self._unnoted: dict[int, FrameNote] = {}
        self._noted_at = time.monotonic()
        handlers = bpy.app.handlers
        self._pairs = (
            (handlers.render_write, self._on_write),
            (handlers.render_complete, self._on_complete),
            (handlers.render_cancel, self._on_cancel),
        )

    def __enter__(self) -> "Arrivals":
        stop_reasons.pop(self._job.scene_name, None)
        # Ours from here on, whatever happens: the next job may replace what this one leaves.
        begun = {frame: FrameNote(self._job.id) for frame in self._plan.drawn}
        note_frames(self._job.folder, begun)
        for place, handler in self._pairs:
            place.append(handler)
        return self

    def __exit__(self, *_: object) -> None:
        for place, handler in self._pairs:
            if handler in place:  # opening a file clears all but the lasting ones
                place.remove(handler)
        self._guarded(self._note)
        stop_reasons.pop(self._job.scene_name, None)

    def _on_write(self, *_: object) -> None:
        if not self.fault and self._waiting:
            self._guarded(self._place)

    def _on_complete(self, *_: object) -> None:
        self.ended = True

    def _on_cancel(self, *_: object) -> None:
        self.ended = self.cancelled = True

    def _guarded(self, work: Callable[[], None]) -> None:
        try:
            work()
        except PlayableEnvironmentError as error:
            self.fault = self.fault or str(error)
        except OSError as error:
            self.fault = self.fault or (
                f"cannot put a frame into {self._job.folder} ({error}); free some space or choose "
                "another frames folder, finished frames are kept"
            )
        if self.fault:
            stop_reasons[self._job.scene_name] = self.fault

    def _place(self) -> None:
        frame = self._waiting.popleft()
        source, target = self._staged / file_name(frame), self._job.file(frame)
        content = source.read_bytes()
        check_png(content, self._plan.size, target)
        source.replace(target)
        digest = self._plan.digests.get(frame, "")
        self._unnoted[frame] = FrameNote(self._job.id, digest, facts_of(content))
        self.placed.append(frame)
        if time.monotonic() - self._noted_at > NOTE_SECONDS:
            self._note()

    def _note(self) -> None:
        if self._unnoted:
            note_frames(self._job.folder, self._unnoted)
        self._unnoted, self._noted_at = {}, time.monotonic()
