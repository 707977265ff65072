"""The one live worker of this Blender, kept in the module because engines come and go per frame.

Several threads may ask (the render job, the preview, operators); one request runs at a time.
"""

import atexit
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import WorkerError
from pe_runtime.contract.messages import Message
from pe_runtime.contract.model_facts import ModelFacts
from pe_runtime.contract.shot import Shot

from .replies import PredictedPaths, RenderedFrame, WorkerCancelledError
from .runtime_python import Places, wanted_python
from .turns import Turns
from .worker_client import OnProgress, ShouldStop, WorkerClient, worker_command

STOPPED, STARTING, READY, BUSY, FAILED = "stopped", "starting", "ready", "busy", "failed"
PREDICTING = "Predicting the paths"
CLOSE_SECONDS = 5.0
PROMISE_SECONDS = 10.0
"""How long a yielding caller leaves alone what was begun for somebody else."""


class Session:
    """Starts a worker when one is needed, loads the model a request names, and asks.

    Every request may be `yielding`: it raises WorkerCancelledError as soon as anybody else wants
    the worker. Others wait for their turn.

    Attributes:
        status: One of `stopped starting ready busy failed`.
        error: The message of the last failure, empty when all is well.
        doing: In words what the worker does before it can draw, empty while it draws or waits.
        times_closed: How often somebody has stopped the worker.
        places: Where the runtime may be.
        arguments: What workers in it are started with.
    """

    def __init__(self) -> None:
        self.status = STOPPED
        self.error = ""
        self.doing = ""
        self.times_closed = 0
        self.places, self.arguments = Places(own=sys.executable), ()
        self._command: list[str] | None = None
        self._client: WorkerClient | None = None
        self._facts: dict[str, ModelFacts] = {}
        self._loaded = ""
        self._turns = Turns()
        self._closing = 0
        self._promised_at = 0.0

    @property
    def worker_pid(self) -> int | None:
        """Process number of the live worker, if there is one."""
        client = self._client
        return client.pid if client and client.alive else None

    @property
    def device(self) -> str:
        """What the loaded model computes on, such as `cpu`; empty before one is loaded."""
        facts = self._facts.get(self._loaded)
        return facts.device if facts else ""

    @property
    def has_command(self) -> bool:
        """Whether somebody said what to start, so that no runtime is looked for."""
        return self._command is not None

    def use_command(self, command: Sequence[str] | None) -> None:
        """Start workers with this command from now on; None means: none is known."""
        self.close()
        self._command = list(command) if command else None

    def facts(
        self, model: str, should_stop: ShouldStop | None = None, yielding: bool = False
    ) -> ModelFacts:
        """What there is to know about a model; loads it on first use."""
        with self.conversation(model, should_stop, yielding):
            return self._facts[model]

    def encode(
        self,
        model: str,
        image: np.ndarray,
        camera: Camera,
        boxes: Mapping[str, Sequence[float]],
        should_stop: ShouldStop | None = None,
        yielding: bool = False,
    ) -> dict[str, Any]:
        """Encode a picture; see `WorkerClient.encode`."""
        with self.conversation(model, should_stop, yielding) as (client, stop):
            self.doing = "Encoding the picture"
            return client.encode(image, camera, boxes, stop)

    def rollout(
        self,
        shot: Shot,
        should_stop: ShouldStop | None = None,
        on_progress: OnProgress | None = None,
        yielding: bool = False,
    ) -> PredictedPaths:
        """Predict paths; see `WorkerClient.rollout`."""
        with self.conversation(shot.model, should_stop, yielding) as (client, stop):
            self.doing = PREDICTING
            return client.rollout(shot, stop, on_progress)

    def render(
        self,
        shot: Shot,
        frame: int,
        should_stop: ShouldStop | None = None,
        whole: Shot | None = None,
        yielding: bool = False,
    ) -> RenderedFrame:
        """Draw one frame; see `WorkerClient.render`."""
        with self.conversation(shot.model, should_stop, yielding) as (client, stop):
            if whole is not None:
                self.doing = PREDICTING
                client.prepare(whole, stop)
            self.doing = ""
            return client.render(shot, frame, stop, whole)

    def foresee(
        self, take: Shot, frame: int, whole: Shot, should_stop: ShouldStop | None = None
    ) -> None:
        """Have a frame begun that is likely to come next; see `WorkerClient.foresee`."""
        # Nobody waits for it: what is wrong is said when the frame itself is asked for.
        with suppress(WorkerError), self.conversation(take.model, should_stop) as (client, _):
            client.foresee(take, frame, whole)
            self._promised_at = time.monotonic()

    def ask(
        self,
        model: str,
        request: Message,
        should_stop: ShouldStop | None = None,
        on_progress: OnProgress | None = None,
        yielding: bool = False,
    ) -> Message:
        """Send any request about a model and return its terminal reply."""
        with self.conversation(model, should_stop, yielding) as (client, stop):
            return client.ask(request, stop, on_progress)

    def close(self) -> None:
        """Stop the worker, if there is one, and forget its failure; a running request gives up."""
        self._closing += 1
        self.times_closed += 1
        try:
            if self._turns.mine:
                self._forget()
            else:
                self._close_in_turn()
        finally:
            self._closing -= 1
        self.status, self.error = STOPPED, ""

    def _close_in_turn(self) -> None:
        try:
            with self._turns.taken(patience=CLOSE_SECONDS):
                if self._client:
                    self._client.stop()
                self._forget()
        except WorkerError:  # whoever has the turn does not listen: end the process under it
            self._forget()

    @contextmanager
    def conversation(
        self, model: str, should_stop: ShouldStop | None = None, yielding: bool = False
    ) -> Iterator[tuple[WorkerClient, ShouldStop]]:
        """The worker with a model loaded, for as long as the block runs, and when to stop.

        Raises:
            WorkerCancelledError: `should_stop` said so, or a yielding caller made way.
            WorkerError: No worker can be had, or it failed.
        """
        own_wish = self._unless_closing(should_stop)

        def stop() -> bool:
            return (yielding and self._turns.wanted) or own_wish()

        with self._turns.taken(yielding, own_wish):
            try:
                if yielding and self._keeps_a_promise():
                    raise WorkerCancelledError("made way for the frame that comes next")
                client = self._ready_client(model, stop, own_wish)
                self.status = BUSY
                yield client, stop
                self.status, self.error = READY, ""
            except BaseException as error:  # the status has to tell of every way out
                self._note(error)
                raise
            finally:
                self.doing = ""

    def _unless_closing(self, should_stop: ShouldStop | None) -> ShouldStop:
        return lambda: bool(self._closing) or (should_stop is not None and should_stop())

    def _keeps_a_promise(self) -> bool:
        """Whether the worker draws a frame that somebody is about to ask for."""
        recent = time.monotonic() - self._promised_at < PROMISE_SECONDS
        return recent and self._client is not None and self._client.foresees

    def _ready_client(self, model: str, stop: ShouldStop, own_wish: ShouldStop) -> WorkerClient:
        if self._client is not None:
            self._end_what_was_cancelled(self._client, stop)
        if self._client is None or not self._client.alive:
            self._forget()
            self.status, self.doing = STARTING, "Starting the runtime"
            # Who waits needs a started worker too: only the caller's own wish ends the start.
            self._client = WorkerClient(self._command or default_command(), should_stop=own_wish)
        if self._loaded != model:
            self._loaded = ""
            self.status, self.doing = STARTING, "Loading the model"
            self._facts[model] = self._client.load(model, stop)
            self._loaded = model
        return self._client

    def _end_what_was_cancelled(self, client: WorkerClient, stop: ShouldStop) -> None:
        """Wait for the end of a request that was given up; who cannot end it is replaced."""
        try:
            client.end_cancelled(stop)
        except WorkerCancelledError:
            raise
        except WorkerError:
            self._forget()

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
    """A worker in the Python that has the runtime, see `find_python`.

    Raises:
        WorkerError: Nobody has said which one that is.
    """
    found = wanted_python(session.places, os.environ)
    return worker_command(found.python, session.arguments)


def use_runtime(places: Places, arguments: Sequence[str] = ()) -> None:
    """Start workers from now on with the Python that is found there then."""
    session.use_command(None)
    session.places, session.arguments = places, tuple(arguments)


def register() -> None:
    """End the worker with Blender, however Blender ends."""
    atexit.register(session.close)


def unregister() -> None:
    """Stop the worker."""
    session.use_command(None)
    atexit.unregister(session.close)
