"""A conversation with one worker process: starts it, asks, waits, notices when it dies.

No `bpy` here: the same client serves Blender, tests and plain Python.
"""

import contextlib
import os
import queue
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

import pe_runtime
from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import WorkerError
from pe_runtime.contract.messages import PROTOCOL, TERMINAL, Message, read_message, write_message
from pe_runtime.contract.model_facts import ModelFacts
from pe_runtime.contract.shot import Shot

from .replies import (
    PredictedPaths,
    RenderedFrame,
    WorkerCancelledError,
    error_from,
    frame_from,
    paths_from,
)

START_SECONDS = 120.0
STOP_SECONDS = 5.0
CANCEL_SECONDS = 20.0
END_SECONDS = 0.5
POLL_SECONDS = 0.05
STDERR_LINES = 40
PIPE_BYTES = 1 << 20
"""Linux: what the pipes hold, so that the worker need not wait until a frame has been read."""
STDERR_LINE_CHARACTERS = 400

ShouldStop = Callable[[], bool]
OnProgress = Callable[[str, int, int], None]


def worker_command(python: str | Path, arguments: Sequence[str] = ()) -> list[str]:
    """The command line that starts a worker with a Python that has the runtime installed.

    `-I` keeps Blender's variables, folder and user packages out of that Python.
    """
    return [str(python), "-I", "-u", "-m", "pe_runtime.worker", *arguments]


class WorkerClient:
    """One worker process from start to end. A dead one stays dead; make another client."""

    def __init__(
        self,
        command: Sequence[str],
        start_seconds: float = START_SECONDS,
        should_stop: ShouldStop | None = None,
    ) -> None:
        """Start the process and greet it.

        Args:
            command: Program and arguments, for example from `worker_command`.
            start_seconds: How long it may take until it answers.
            should_stop: Asked until it does.

        Raises:
            WorkerCancelledError: `should_stop` said so; nothing is left of the process.
            WorkerError: It cannot be started, dies, stays silent or speaks another protocol.
        """
        self.command = list(command)
        self._stderr: deque[str] = deque(maxlen=STDERR_LINES)
        self._inbox: queue.Queue[Message | WorkerError | None] = queue.Queue()
        self._owes_reply = False
        self._whole: Shot | None = None
        self._foreseen: tuple[Shot, int] | None = None
        self._loading = ""
        self._process = self._launch()
        self._threads = [self._read(self._drain_stderr), self._read(self._receive)]
        try:
            greeting = {"protocol": PROTOCOL, "version": pe_runtime.__version__}
            self.ask(Message("hello", greeting), should_stop, seconds=start_seconds)
        except BaseException:  # nobody will hold the client, so nobody else could stop it
            self.kill()
            raise

    @property
    def alive(self) -> bool:
        """Whether the process still runs."""
        return self._process.poll() is None

    @property
    def pid(self) -> int:
        """Process number, for tests and for people who look at a process list."""
        return self._process.pid

    @property
    def foresees(self) -> bool:
        """Whether it draws a frame that nobody has asked for yet."""
        return self._foreseen is not None

    def load(self, model: str, should_stop: ShouldStop | None = None) -> ModelFacts:
        """Load a model by built-in name or path and return what Blender must know of it.

        Given up, it goes on loading, and the next call for the same model waits for that.
        """
        self._whole = None
        if self._loading != model:
            self._begin(Message("load", {"model": model}), should_stop)
            self._loading = model
        return ModelFacts.from_fields(self._finish("load", should_stop).fields)

    def encode(
        self,
        image: np.ndarray,
        camera: Camera,
        boxes: Mapping[str, Sequence[float]],
        should_stop: ShouldStop | None = None,
    ) -> dict:
        """Encode a picture into a state.

        Args:
            image: (height, width, 3) uint8 sRGB.
            camera: The camera that saw it, of the same size.
            boxes: Per playable object left, top, right, bottom in pixels.
            should_stop: Asked while the worker encodes.

        Returns:
            The state as JSON values, as `state_as_dict` writes it.
        """
        listed = {name: [float(edge) for edge in box] for name, box in boxes.items()}
        fields = {"camera": camera.as_dict(), "boxes": listed}
        return self.ask(Message("encode", fields, {"image": image}), should_stop).fields["state"]

    def rollout(
        self,
        shot: Shot,
        should_stop: ShouldStop | None = None,
        on_progress: OnProgress | None = None,
    ) -> PredictedPaths:
        """Predict where the playable objects go."""
        message = Message("rollout", {"shot": shot.as_dict()})
        return paths_from(self.ask(message, should_stop, on_progress=on_progress))

    def render(
        self,
        shot: Shot,
        frame: int,
        should_stop: ShouldStop | None = None,
        whole: Shot | None = None,
    ) -> RenderedFrame:
        """Draw one frame of a shot.

        Args:
            shot: What is drawn.
            frame: The frame of it.
            should_stop: Asked while the worker draws.
            whole: The shot that this is a take of: its prediction holds. It is sent only when it
                is another object than the last one.

        Raises:
            WorkerCancelledError: `should_stop` said so.
            WorkerError: The worker failed, died or answered without the frame.
        """
        if whole is not None:
            self.prepare(whole, should_stop)
        if self._foreseen != (shot, frame) or whole is None:
            self._begin(_render_request(shot, frame, whole is not None), should_stop)
        frames: list[Message] = []
        self._finish("render", should_stop, on_frame=frames.append)
        if [each.fields.get("number") for each in frames] != [frame]:
            numbers = [each.fields.get("number") for each in frames]
            raise WorkerError(f"asked the worker for frame {frame}, it sent {numbers}")
        return frame_from(frames[0])

    def foresee(self, take: Shot, frame: int, whole: Shot) -> None:
        """Let the worker begin with a frame that is likely to be wanted next.

        Whatever is asked for next, the answer is right: another request ends this one.
        """
        self.prepare(whole, None)
        self._begin(_render_request(take, frame, True))
        self._foreseen = take, frame

    def ask(
        self,
        request: Message,
        should_stop: ShouldStop | None = None,
        on_progress: OnProgress | None = None,
        seconds: float | None = None,
    ) -> Message:
        """Send a request and return its terminal reply."""
        self._begin(request, should_stop)
        return self._finish(request.type, should_stop, on_progress, seconds=seconds)

    def prepare(self, whole: Shot, should_stop: ShouldStop | None = None) -> None:
        """Have a shot predicted that takes will be parts of, unless it is the last one already."""
        if self._whole is not whole:
            self._whole = None
            self.ask(Message("prepare", {"shot": whole.as_dict()}), should_stop)
            self._whole = whole

    def end_cancelled(self, should_stop: ShouldStop | None = None) -> None:
        """Wait until a request that was given up has ended; what goes on usefully may go on.

        Raises:
            WorkerCancelledError: `should_stop` said so.
            WorkerError: It does not end; the process was killed.
        """
        if not self._loading and self._foreseen is None:
            self._settle(should_stop)

    def stop(self) -> None:
        """Let the worker end by itself; kill it if it does not."""
        with contextlib.suppress(OSError, ValueError, WorkerError):
            write_message(self._process.stdin, Message("stop"))
            self._process.stdin.close()
        try:
            self._process.wait(STOP_SECONDS)
        except subprocess.TimeoutExpired:
            self._process.kill()
        self._close()

    def kill(self) -> None:
        """End the worker now."""
        if self.alive:
            self._process.kill()
        self._close()

    def _launch(self) -> subprocess.Popen:
        pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
        flags = subprocess.CREATE_NO_WINDOW if sys.platform == "win32" else 0
        try:
            return subprocess.Popen(
                self.command,
                creationflags=flags,
                env=_environment(),
                pipesize=PIPE_BYTES,
                **pipes,
            )
        except OSError as error:
            raise WorkerError(
                f"cannot start the runtime {self.command[0]!r} ({error}); set the runtime Python "
                "in the add-on's preferences to one that has playable-environments installed"
            ) from error

    def _read(self, work: Callable[[], None]) -> threading.Thread:
        thread = threading.Thread(target=work, daemon=True, name=f"playable {work.__name__}")
        thread.start()
        return thread

    def _drain_stderr(self) -> None:
        # A full stderr pipe would stop the worker, so it is always read; only the tail is kept.
        with contextlib.suppress(ValueError, OSError):
            for line in self._process.stderr:
                text = line.decode("utf-8", "replace").rstrip()
                self._stderr.append(text[:STDERR_LINE_CHARACTERS])

    def _receive(self) -> None:
        try:
            while (message := read_message(self._process.stdout)) is not None:
                self._inbox.put(message)
            self._inbox.put(None)
        except (WorkerError, OSError, ValueError) as error:
            self._inbox.put(WorkerError(str(error)))

    def _begin(self, request: Message, should_stop: ShouldStop | None = None) -> None:
        self._settle(should_stop)
        self._send(request)
        self._owes_reply = True

    def _finish(
        self,
        asked: str,
        should_stop: ShouldStop | None = None,
        on_progress: OnProgress | None = None,
        on_frame: Callable[[Message], None] | None = None,
        seconds: float | None = None,
    ) -> Message:
        """Wait for the terminal reply of the request that was sent last."""
        self._foreseen = None
        for reply in self._replies(asked, should_stop, seconds):
            if reply.type == "progress" and on_progress:
                on_progress(*(reply.fields[key] for key in ("stage", "done", "total")))
            elif reply.type == "frame" and on_frame:
                on_frame(reply)
            elif reply.type in TERMINAL:
                self._owes_reply, self._loading = False, ""
                if reply.type == "failure":
                    raise error_from(reply)
                return reply
        raise AssertionError("unreachable: _replies ends only by raising")

    def _send(self, message: Message) -> None:
        try:
            write_message(self._process.stdin, message)
        except (OSError, ValueError) as error:
            raise self._death(message.type) from error

    def _replies(
        self, asked: str, should_stop: ShouldStop | None, seconds: float | None
    ) -> Iterator[Message]:
        deadline = None if seconds is None else time.monotonic() + seconds
        while True:
            try:
                reply = self._inbox.get(timeout=POLL_SECONDS)
            except queue.Empty:
                if should_stop and should_stop():
                    self._cancel(asked)
                if deadline is not None and time.monotonic() > deadline:
                    self.kill()
                    raise WorkerError(
                        f"the worker did not answer {asked!r} within {seconds:g} s{self._tail()}"
                    ) from None
                continue
            if reply is None:
                raise self._death(asked)
            if isinstance(reply, WorkerError):
                if self._ends_by_itself():  # killed while it wrote: its end is the reason
                    raise self._death(asked) from reply
                self.kill()
                raise WorkerError(f"{reply}{self._tail()}") from reply
            yield reply
            # It was not the last one: a worker that never pauses is stopped all the same.
            if should_stop and should_stop():
                self._cancel(asked)

    def _cancel(self, asked: str) -> None:
        """Tell the worker to give up and return at once; its last reply is read later."""
        if not self._loading:
            self._send(Message("cancel"))
        raise WorkerCancelledError(f"{asked} was cancelled")

    def _settle(self, should_stop: ShouldStop | None) -> None:
        """Read what is left of a request that nobody waits for: cancelled, or foreseen wrongly."""
        # What nobody told to end until now may take as long as it would have anyway.
        goes_on = self._foreseen is not None or self._loading
        seconds = None if goes_on else CANCEL_SECONDS
        if not self._owes_reply:
            return
        self._send(Message("cancel"))
        for reply in self._replies("cancel", should_stop, seconds):
            if reply.type in TERMINAL:
                self._owes_reply, self._foreseen, self._loading = False, None, ""
                return

    def _ends_by_itself(self) -> bool:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(END_SECONDS)
        return not self.alive

    def _death(self, asked: str) -> WorkerError:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(STOP_SECONDS)
        code = self._process.poll()
        self.kill()
        return WorkerError(
            f"the worker ended (exit code {code}) before it answered {asked!r}; "
            f"the next request starts another{self._tail()}"
        )

    def _tail(self) -> str:
        self._threads[0].join(0.5)
        lines = [line for line in self._stderr if line]
        return "\nThe worker's last words:\n" + "\n".join(lines) if lines else ""

    def _close(self) -> None:
        self._process.wait(STOP_SECONDS)
        for thread in self._threads:
            thread.join(STOP_SECONDS)
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            with contextlib.suppress(OSError):
                pipe.close()


def _environment() -> dict[str, str]:
    # Blender's own PYTHON* variables belong to Blender's Python.
    return {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}


def _render_request(shot: Shot, frame: int, is_take: bool) -> Message:
    fields = {"shot": shot.as_dict(), "frames": [frame]}
    return Message("render", fields | {"take": True} if is_take else fields)
