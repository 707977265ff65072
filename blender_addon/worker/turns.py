"""Whose turn it is to speak with the worker: one caller at a time, and some make way for others.

A yielding caller (a preview, a live path) never keeps anybody waiting; a plain one waits for its
turn, but not for ever. No `bpy` here.
"""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from pe_runtime.contract.errors import WorkerError

from .replies import WorkerCancelledError

POLL_SECONDS = 0.05
PATIENCE_SECONDS = 60.0
MAIN_THREAD_PATIENCE_SECONDS = 5.0
"""A window that waits longer for another request looks as if it had crashed."""
BUSY_MESSAGE = "the worker is busy with another request; wait until it is done"


class Turns:
    """Gives the turn to one thread at a time."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._holder: int | None = None
        self._holder_yields = False
        self._waiting = 0

    @property
    def wanted(self) -> bool:
        """Whether a caller waits that nobody should keep waiting."""
        return self._waiting > 0

    @property
    def mine(self) -> bool:
        """Whether this very thread has the turn."""
        return self._holder == threading.get_ident()

    @contextmanager
    def taken(
        self,
        yielding: bool = False,
        should_stop: Callable[[], bool] | None = None,
        patience: float | None = None,
    ) -> Iterator[None]:
        """Wait for the turn and have it for as long as the block runs.

        Args:
            yielding: Give up as soon as a plain caller has the turn or waits for it.
            should_stop: Asked while waiting.
            patience: Seconds to wait for another plain caller; None: a minute, or some seconds on
                the main thread.

        Raises:
            WorkerCancelledError: It made way, or `should_stop` said so.
            WorkerError: This thread has the turn already, or another one keeps it for too long.
        """
        if self.mine:  # a question from inside another one's callback could only wait for itself
            raise WorkerError(BUSY_MESSAGE)
        if yielding:
            self._wait_modestly(should_stop)
        else:
            self._wait(should_stop, _usual_patience() if patience is None else patience)
        try:
            yield
        finally:
            with self._changed:
                self._holder = None
                self._changed.notify_all()

    def _wait(self, should_stop: Callable[[], bool] | None, patience: float) -> None:
        with self._changed:
            self._waiting += 1
        waited_since = time.monotonic()
        try:
            while not self._try_taking(yielding=False):
                if should_stop and should_stop():
                    raise WorkerCancelledError("given up while waiting for another request")
                # A yielding caller ends by itself: only what it cannot leave half done takes time.
                if self._holder_yields:
                    waited_since = time.monotonic()
                elif time.monotonic() - waited_since > patience:
                    raise WorkerError(BUSY_MESSAGE)
        finally:
            with self._changed:
                self._waiting -= 1

    def _wait_modestly(self, should_stop: Callable[[], bool] | None) -> None:
        while not self._try_taking(yielding=True):
            plain_caller = self._holder is not None and not self._holder_yields
            if self.wanted or plain_caller or (should_stop and should_stop()):
                raise WorkerCancelledError("made way for another request")

    def _try_taking(self, yielding: bool) -> bool:
        """Take the turn if it is free; otherwise wait for a moment."""
        with self._changed:
            if self._holder is None and not (yielding and self.wanted):
                self._holder, self._holder_yields = threading.get_ident(), yielding
                return True
            if not yielding or self._holder_yields:
                self._changed.wait(POLL_SECONDS)
            return False


def _usual_patience() -> float:
    on_main_thread = threading.current_thread() is threading.main_thread()
    return MAIN_THREAD_PATIENCE_SECONDS if on_main_thread else PATIENCE_SECONDS
