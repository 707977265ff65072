"""A call that runs in a thread while Blender stays alive. No `bpy` here."""

import threading
import time
from collections.abc import Callable

from .worker_client import OnProgress, ShouldStop

PATIENCE_SECONDS = 0.3
"""How long a call that was cancelled may take to end before nobody waits for it any more."""
Work = Callable[[ShouldStop, OnProgress], object]


class BackgroundCall:
    """Runs `work(should_stop, on_progress)` at once in a thread.

    Attributes:
        done: Whether it has ended, one way or another.
        stage: What it says it is doing.
        progress: Share that is done, in [0, 1].
    """

    def __init__(self, work: Work) -> None:
        self.stage, self.progress = "", 0.0
        self._work = work
        self._cancelled = threading.Event()
        self._cancelled_at = 0.0
        self._result: object = None
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, daemon=True, name="playable call")
        self._thread.start()

    @property
    def done(self) -> bool:
        """Whether it has ended, one way or another."""
        return not self._thread.is_alive()

    @property
    def cancelled(self) -> bool:
        """Whether it was asked to give up."""
        return self._cancelled.is_set()

    @property
    def overdue(self) -> bool:
        """Whether it goes on though it was asked to give up; then its result is not wanted."""
        waited = time.monotonic() - self._cancelled_at
        return self.cancelled and not self.done and waited > PATIENCE_SECONDS

    def cancel(self) -> None:
        """Ask it to give up, which it does soon or is left to itself."""
        if not self.cancelled:
            self._cancelled_at = time.monotonic()
            self._cancelled.set()

    def result(self) -> object:
        """Wait, then return what the work returned or raise what it raised."""
        self._thread.join()
        if self._error is not None:
            raise self._error
        return self._result

    def _run(self) -> None:
        try:
            self._result = self._work(self._cancelled.is_set, self._note)
        # Whatever it was, it is raised again where the result is asked for.
        except BaseException as error:  # noqa: BLE001
            self._error = error

    def _note(self, stage: str, done: int, total: int) -> None:
        self.stage, self.progress = stage, done / total if total else 0.0
