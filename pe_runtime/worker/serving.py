"""The worker's loop: one request after the other, each with exactly one terminal reply."""

import queue
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from io import BufferedIOBase
from typing import Any, Protocol, runtime_checkable

import numpy as np

import pe_runtime
from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import PlayableEnvironmentError, ShotError, WorkerError
from pe_runtime.contract.messages import (
    CANCELLED,
    PROTOCOL,
    REQUESTS,
    Message,
    failure,
    read_message,
    write_message,
)
from pe_runtime.contract.model_facts import ModelFacts
from pe_runtime.contract.shot import Shot
from pe_runtime.contract.shot_track import Box
from pe_runtime.contract.shot_values import read_row


@dataclass(frozen=True)
class Picture:
    """One drawn frame as it travels: bytes for the picture, floats for the passes."""

    number: int
    buffers: dict[str, np.ndarray]
    """rgb uint8 (height, width, 3); depth float32 and 'mask:NAME' float32 (height, width)."""
    seconds: float = 0.0
    """How long drawing it took, without the way to bytes."""


@runtime_checkable
class World(Protocol):
    """What the worker serves: a trained environment, or the fake one."""

    def load(self, model: str) -> ModelFacts:
        """Make a model ready."""

    def encode(self, image: np.ndarray, camera: Camera, boxes: Mapping[str, Box]) -> dict[str, Any]:
        """State of a picture, uint8 (height, width, 3), as JSON values."""

    def rollout(self, shot: Shot) -> dict[str, np.ndarray]:
        """Predicted paths as the buffers of the reply to ``rollout``."""

    def render(self, shot: Shot, frames: list[int], whole: Shot | None = None) -> Iterator[Picture]:
        """Draw frames of the shot one by one.

        Args:
            shot: What is drawn.
            frames: Frames of it.
            whole: The shot that this one is a part of; its prediction holds, not the part's own.
        """

    def proxy_mesh(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """A stand-in for the viewport: vertices (n, 3) float32, faces (m, 3) int32."""


def box_mesh(
    low: tuple[float, float, float], high: tuple[float, float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (8, 3) float32 and outward triangles (12, 3) int32 of an upright box, metres."""
    corners = np.array(np.meshgrid(*zip(low, high, strict=True), indexing="ij"), np.float32)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    return corners.reshape(3, 8).T.copy(), np.array(triangles, np.int32)


class Inbox:
    """Requests in order of arrival; a thread reads on while one is being answered.

    `cancel` reaches every request that came before it and none that comes after.
    """

    def __init__(self, source: BufferedIOBase) -> None:
        self._source = source
        self._waiting: queue.SimpleQueue[tuple[int, Message | WorkerError | None]]
        self._waiting = queue.SimpleQueue()
        self._received = 0
        self._cancelled = 0
        threading.Thread(target=self._read, name="wire reader", daemon=True).start()

    def next(self) -> tuple[int, Message | None]:
        """The next request and its number; None after `stop` or at the end of the stream.

        Raises:
            WorkerError: What came is not a message.
        """
        number, message = self._waiting.get()
        if isinstance(message, WorkerError):
            raise message
        return number, message

    def is_cancelled(self, number: int) -> bool:
        """Whether a `cancel` or `stop` came after this request."""
        return number <= self._cancelled

    def _read(self) -> None:
        message: Message | WorkerError | None = None
        while True:
            try:
                message = read_message(self._source)
            except WorkerError as error:
                message = error
            if isinstance(message, Message) and message.type in ("cancel", "stop"):
                self._cancelled = self._received
                if message.type == "cancel":
                    continue
                message = None
            self._received += 1
            self._waiting.put((self._received, message))
            if not isinstance(message, Message):
                return


@dataclass(frozen=True)
class _Call:
    """One request with what its handler needs beside the world."""

    fields: Mapping[str, Any]
    buffers: Mapping[str, np.ndarray]
    send: Callable[[Message], None]
    is_cancelled: Callable[[], bool]


class _CancelledError(Exception):
    """Leaves a handler whose request was cancelled."""


class _Session:
    """What one connection has said so far, and the answers to what it may say."""

    def __init__(self, make_world: Callable[[], World]) -> None:
        self._make_world = make_world
        self._greeted = False
        self._world: World | None = None
        self._model = ""
        self._whole: Shot | None = None

    def answer(self, request: Message, call: _Call) -> Message:
        """The terminal reply."""
        answers = {
            "hello": self._hello,
            "load": self._load,
            "encode": self._encode,
            "rollout": self._rollout,
            "prepare": self._prepare,
            "render": self._render,
            "proxy_mesh": self._proxy_mesh,
        }
        if request.type not in answers:
            raise WorkerError(f"{request.type!r} is no request; expected {', '.join(REQUESTS)}")
        if request.type != "hello" and not self._greeted:
            raise WorkerError(f"{request.type!r} came before hello; send hello first")
        return answers[request.type](call)

    def _hello(self, call: _Call) -> Message:
        own = {"protocol": PROTOCOL, "version": pe_runtime.__version__}
        for name, mine in own.items():
            if call.fields.get(name) != mine:
                raise WorkerError(
                    f"the other side speaks {name} {call.fields.get(name)!r}, this worker "
                    f"{mine!r}; install the add-on and the runtime in the same version"
                )
        self._greeted = True
        return Message("ready", own)

    def _load(self, call: _Call) -> Message:
        model = _field(call, "model", str)
        world = self._make_world()
        facts = world.load(model)
        self._world, self._model, self._whole = world, model, None
        return Message("ready", facts.as_fields())

    def _encode(self, call: _Call) -> Message:
        if "image" not in call.buffers:
            raise WorkerError("encode needs a buffer 'image'; found " + str(list(call.buffers)))
        image = call.buffers["image"]
        if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
            raise WorkerError(
                f"encode needs an image of uint8 (height, width, 3), found {image.dtype} "
                f"{image.shape}"
            )
        camera = Camera.from_dict(_field(call, "camera", dict), "encode.camera")
        listed = _field(call, "boxes", dict)
        boxes = {name: read_row(box, f"encode.boxes[{name!r}]", 4) for name, box in listed.items()}
        state = self._loaded().encode(image, camera, boxes)
        return Message("state", {"state": state})

    def _rollout(self, call: _Call) -> Message:
        shot = self._shot(call)
        return Message("state", {"fps": shot.fps}, self._loaded().rollout(shot))

    def _prepare(self, call: _Call) -> Message:
        self._whole, whole = None, self._shot(call)
        self._loaded().rollout(whole)
        self._whole = whole
        return Message("ready")

    def _render(self, call: _Call) -> Message:
        shot = self._shot(call)
        frames = _wanted_frames(shot, call.fields.get("frames"))
        within = (self._whole_of(shot),) if call.fields.get("take") else ()
        pictures, total = self._loaded().render(shot, frames, *within), len(frames)
        for done in range(total):
            if call.is_cancelled():
                raise _CancelledError(f"cancelled after {done} of {total} frames")
            picture = next(pictures)
            fields = {"number": picture.number, "seconds": picture.seconds}
            call.send(Message("frame", fields, picture.buffers))
            call.send(Message("progress", {"stage": "render", "done": done + 1, "total": total}))
        return Message("ready", {"frames": total})

    def _proxy_mesh(self, call: _Call) -> Message:
        vertices, faces = self._loaded().proxy_mesh(_field(call, "object", str))
        return Message("state", {}, {"vertices": vertices, "faces": faces})

    def _whole_of(self, take: Shot) -> Shot:
        """The prepared shot, if the take can be a part of it."""
        whole = self._whole
        if whole is None:
            raise WorkerError(
                "no shot is prepared that this could be a take of; send prepare first"
            )
        known = {track.name: track.styles for track in whole.objects}
        styles = {track.name: track.styles for track in take.objects}
        if not set(take.frames) <= set(whole.frames) or not styles.items() <= known.items():
            raise ShotError(
                f"a take of the prepared shot has frames of {whole.frame_start} to "
                f"{whole.frame_end} and objects of {sorted(known)} in their styles, found frames "
                f"{take.frame_start} to {take.frame_end} and objects {sorted(styles)}"
            )
        return whole

    def _loaded(self) -> World:
        if self._world is None:
            raise WorkerError("no model is loaded; send load first")
        return self._world

    def _shot(self, call: _Call) -> Shot:
        self._loaded()
        shot = Shot.from_dict(_field(call, "shot", dict))
        if shot.model != self._model:
            raise WorkerError(
                f"the shot asks for the model {shot.model!r}, loaded is {self._model!r}; "
                "send load first"
            )
        return shot


def serve(make_world: Callable[[], World], inbox: Inbox, sink: BufferedIOBase) -> int:
    """Answer requests until `stop` or the end of the stream.

    Returns:
        Exit code: 0 at a clean end, 1 after bytes that are no message.
    """
    session = _Session(make_world)
    while True:
        try:
            number, request = inbox.next()
        except WorkerError as error:
            # Where the next message begins is unknown now: say so and end.
            write_message(sink, failure("WorkerError", str(error)))
            return 1
        if request is None:
            return 0
        write_message(sink, _reply(session, number, request, inbox, sink))


def _reply(
    session: _Session, number: int, request: Message, inbox: Inbox, sink: BufferedIOBase
) -> Message:
    """The terminal reply of one request, whatever happens inside."""
    call = _Call(
        request.fields,
        request.buffers,
        send=lambda message: write_message(sink, message),
        is_cancelled=lambda: inbox.is_cancelled(number),
    )
    try:
        if call.is_cancelled():
            raise _CancelledError("cancelled before it began")
        return session.answer(request, call)
    except _CancelledError as stop:
        return failure(CANCELLED, str(stop))
    except PlayableEnvironmentError as error:
        if isinstance(error, WorkerError):
            traceback.print_exc(file=sys.stderr)
        return failure(type(error).__name__, str(error))
    except BrokenPipeError:
        raise
    except Exception as error:  # noqa: BLE001 a request without a reply would hang Blender
        traceback.print_exc(file=sys.stderr)
        return failure(type(error).__name__, f"{error} (a bug; the worker's log has more)")


def _wanted_frames(shot: Shot, frames: object) -> list[int]:
    """The frames to draw, ascending; null asks for all."""
    if frames is None:
        return list(shot.frames)
    if not isinstance(frames, list) or any(type(frame) is not int for frame in frames):
        raise WorkerError(
            f"the field 'frames' must be a list of numbers or null, found {frames!r:.100}"
        )
    outside = sorted(set(frames) - set(shot.frames))
    if outside:
        raise ShotError(
            f"frames {outside} are not in the shot; it has {shot.frame_start} to {shot.frame_end}"
        )
    return sorted(set(frames))


def _field(call: _Call, name: str, kind: type) -> Any:  # noqa: ANN401
    value = call.fields.get(name)
    if not isinstance(value, kind):
        raise WorkerError(f"the field {name!r} must be a {kind.__name__}, found {value!r:.100}")
    return value
