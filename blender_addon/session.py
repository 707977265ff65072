"""The one live worker of this Blender, kept in the module because engines come and go per frame.

Several threads may ask (the render job and the main one); one request runs at a time.
"""

import atexit
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import WorkerError
from pe_runtime.contract.model_facts import ModelFacts
from pe_runtime.contract.shot import Shot

from .replies import PredictedPaths, RenderedFrame, WorkerCancelledError
from .worker_client import OnProgress, ShouldStop, WorkerClient, worker_command

STOPPED, STARTING, READY, BUSY, FAILED = "stopped", "starting", "ready", "busy", "failed"


class Session:
    """Starts a worker when one is needed, loads the model a request names, and asks.

    Attributes:
        status: One of `stopped starting ready busy failed`.
        error: The message of the last failure, empty when all is well.
    """

    def __init__(self) -> None:
        self.status = STOPPED
        self.error = ""
        self._command: list[str] | None = None
        self._client: WorkerClient | None = None
        self._facts: dict[str, ModelFacts] = {}
        self._loaded = ""
        self._lock = threading.Lock()

    @property
    def worker_pid(self) -> int | None:
        """Process number of the live worker, if there is one."""
        client = self._client
        return client.pid if client and client.alive else None

    def use_command(self, command: Sequence[str] | None) -> None:
        """Start workers with this command from now on; None means: none is known."""
        self.close()
        self._command = list(command) if command else None

    def facts(self, model: str) -> ModelFacts:
        """What there is to know about a model; loads it on first use."""
        with self._conversation(model):
            return self._facts[model]

    def encode(
        self, model: str, image: np.ndarray, camera: Camera, boxes: Mapping[str, Sequence[float]]
    ) -> dict[str, Any]:
        """Encode a picture; see `WorkerClient.encode`."""
        with self._conversation(model) as client:
            return client.encode(image, camera, boxes)

    def rollout(
        self,
        shot: Shot,
        should_stop: ShouldStop | None = None,
        on_progress: OnProgress | None = None,
    ) -> PredictedPaths:
        """Predict paths; see `WorkerClient.rollout`."""
        with self._conversation(shot.model) as client:
            return client.rollout(shot, should_stop, on_progress)

    def render(
        self,
        shot: Shot,
        frame: int,
        should_stop: ShouldStop | None = None,
        whole: Shot | None = None,
    ) -> RenderedFrame:
        """Draw one frame; see `WorkerClient.render`."""
        with self._conversation(shot.model) as client:
            return client.render(shot, frame, should_stop, whole)

    def foresee(self, take: Shot, frame: int, whole: Shot) -> None:
        """Have a frame begun that is likely to come next; see `WorkerClient.foresee`."""
        # Nobody waits for it: what is wrong is said when the frame itself is asked for.
        with suppress(WorkerError), self._conversation(take.model) as client:
            client.foresee(take, frame, whole)

    def close(self) -> None:
        """Stop the worker, if there is one, and forget its failure."""
        with self._lock:
            if self._client:
                self._client.stop()
            self._forget()
            self.status, self.error = STOPPED, ""

    @contextmanager
    def _conversation(self, model: str) -> Iterator[WorkerClient]:
        if not self._lock.acquire(blocking=False):
            raise WorkerError("the worker is busy with another request; wait until it is done")
        try:
            client = self._ready_client(model)
            self.status = BUSY
            yield client
            self.status, self.error = READY, ""
        except BaseException as error:  # the status has to tell of every way out
            self._note(error)
            raise
        finally:
            self._lock.release()

    def _ready_client(self, model: str) -> WorkerClient:
        if self._client is None or not self._client.alive:
            self._forget()
            self.status = STARTING
            self._client = WorkerClient(self._command or default_command())
        if self._loaded != model:
            self._loaded = ""
            self._facts[model] = self._client.load(model)
            self._loaded = model
        return self._client

    def _note(self, error: BaseException) -> None:
        if self._client is None or not self._client.alive:
            self._forget()
        if isinstance(error, WorkerCancelledError):
            self.status = READY if self._client else STOPPED
            return
        self.status = READY if self._client else FAILED
        self.error = str(error)

    def _forget(self) -> None:
        if self._client is not None:
            self._client.kill()
        self._client, self._loaded = None, ""
        self._facts.clear()


session = Session()


def default_command() -> list[str]:
    """A worker in this very Python, where that is a Python and not Blender's own.

    Raises:
        WorkerError: Nobody has said which Python has the runtime.
    """
    runs_in_blender = "bpy" in sys.modules and bool(sys.modules["bpy"].app.binary_path)
    if runs_in_blender:
        raise WorkerError(
            "no runtime is set; in the add-on's preferences choose a Python that has "
            "playable-environments installed"
        )
    return worker_command(sys.executable)


def use_python(python: str, arguments: Sequence[str] = ()) -> None:
    """Start workers with this Python from now on; an empty path means this one."""
    if not python and not arguments:
        session.use_command(None)
    else:
        session.use_command(worker_command(python or sys.executable, arguments))


def register() -> None:
    """End the worker with Blender, however Blender ends."""
    atexit.register(session.close)


def unregister() -> None:
    """Stop the worker."""
    session.use_command(None)
    atexit.unregister(session.close)
