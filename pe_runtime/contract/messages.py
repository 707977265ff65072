"""The wire between Blender and the worker: typed messages on a byte stream, never a pickle.

One message is an 8-byte little-endian header length, a JSON header
``{"type", "fields", "buffers": [{"name", "dtype", "shape"}, ...]}`` and the raw buffers in the
order of the header, C-contiguous and little-endian.

Every request but ``cancel`` and ``stop`` ends with exactly one terminal reply (``TERMINAL``);
``progress`` and ``frame`` may come before it.
"""

import json
import math
from dataclasses import dataclass, field
from io import BufferedIOBase
from typing import Any

import numpy as np

from .errors import WorkerError

PROTOCOL = 4
"""Version of this vocabulary, compared at ``hello``."""

REQUESTS = {
    "hello": "fields protocol, version -> ready",
    "load": "fields model -> ready, with the ModelFacts as fields",
    "encode": "fields camera, boxes; buffer image uint8 (height, width, 3) -> state, field state",
    "rollout": "fields shot -> state, field fps; one (frames, 3) float64 buffer per object: "
    "positions in environment space, metres; 'heading:NAME' (frames,) float64 for each object "
    "whose heading the model predicts: radians about z",
    "prepare": "fields shot -> ready; it is rolled out and kept, the one before is forgotten",
    "render": "fields shot, frames (list or null for all), take (true: the shot is a part of the "
    "prepared one and keeps its prediction) -> progress and frame, then ready",
    "digests": "fields shot, take (as for render) -> state, field digests: by frame number (as "
    "text) a hex digest over everything that decides the frame's pixels, weights too",
    "infer_actions": "fields states (as of encode, one model step apart), cameras (one per state) "
    "-> state, field actions: by playable object the action indices, one fewer than states",
    "match_camera": "fields width, height (pixels), points (four or more of [u, v, x, y]: a pixel "
    "and the environment's metres on the ground, z = 0), focal (pixels; null: solved for) -> "
    "state, fields camera, residual (root mean square, pixels), worst (pixels)",
    "detect": "field names (playable objects); buffer image uint8 (height, width, 3) -> state, "
    "fields boxes (by name: left, top, right, bottom in pixels) and scores (by name, 0 to 1); "
    "names that are not found are left out",
    "proxy_mesh": "fields object -> state; buffers vertices (n, 3) float32, faces (m, 3) int32",
    "cancel": "no reply of its own; running and waiting requests end with failure 'cancelled'",
    "stop": "no reply; the worker ends with exit code 0",
}
REPLIES = {
    "ready": "the request is done",
    "progress": "fields stage, done, total",
    "state": "the answer of a request that asks for values",
    "frame": "fields number, seconds (that drawing took); buffers rgb uint8 (height, width, 3), "
    "depth float32 (height, width) in metres with +inf where nothing is, 'mask:NAME' float32 "
    "(height, width), 'layer:NAME' uint8 (height, width, 4) with straight alpha, background uint8 "
    "(height, width, 3); height and width are those of the shot's region where it has one",
    "failure": "fields kind (an error class name, or CANCELLED) and message",
}
TERMINAL = frozenset({"ready", "state", "failure"})
CANCELLED = "cancelled"
HEADING_PREFIX = "heading:"
"""Before an object's name: the buffer of its headings."""

MAX_HEADER_BYTES = 1 << 26
MAX_MESSAGE_BYTES = 1 << 30
DTYPES = ("uint8", "int32", "int64", "float16", "float32", "float64", "bool")


@dataclass(frozen=True)
class Message:
    """One message: its type, JSON fields and named arrays."""

    type: str
    fields: dict[str, Any] = field(default_factory=dict)
    buffers: dict[str, np.ndarray] = field(default_factory=dict)


def failure(kind: str, message: str) -> Message:
    """The terminal reply of a request that failed."""
    return Message("failure", {"kind": kind, "message": message})


def write_message(stream: BufferedIOBase, message: Message) -> None:
    """Write one message and flush.

    Raises:
        WorkerError: Unknown type, fields that are not JSON, or an array of a dtype outside DTYPES.
    """
    _check_type(message.type)
    arrays = {name: _wire_array(name, array) for name, array in message.buffers.items()}
    entries = [
        {"name": name, "dtype": array.dtype.name, "shape": list(array.shape)}
        for name, array in arrays.items()
    ]
    content = {"type": message.type, "fields": message.fields, "buffers": entries}
    try:
        header = json.dumps(content, allow_nan=False, separators=(",", ":")).encode()
    except (TypeError, ValueError) as error:
        raise WorkerError(f"a {message.type!r} message cannot be written as JSON: {error}") from (
            error
        )
    _check_size(len(header), sum(array.nbytes for array in arrays.values()))
    stream.write(len(header).to_bytes(8, "little") + header)
    for array in arrays.values():
        stream.write(array)
    stream.flush()


def read_message(stream: BufferedIOBase) -> Message | None:
    """Read one message; None when the stream ended cleanly between two messages.

    Raises:
        WorkerError: The stream ended inside a message, or what came is not a message.
    """
    prefix = _read(stream, 8, "length", may_end=True)
    if prefix is None:
        return None
    length = int.from_bytes(prefix, "little")
    if not 0 < length <= MAX_HEADER_BYTES:
        raise WorkerError(
            f"expected a header of 1 to {MAX_HEADER_BYTES} bytes, found the length {length} "
            f"(bytes {prefix!r}): something other than the protocol wrote to the pipe"
        )
    message_type, fields, entries = _parse_header(_read(stream, length, "header"))
    sizes = [math.prod(shape) * np.dtype(dtype).itemsize for _, dtype, shape in entries]
    _check_size(length, sum(sizes))
    buffers = {}
    for (name, dtype, shape), size in zip(entries, sizes, strict=True):
        content = _read(stream, size, f"buffer {name!r}")
        little = np.dtype(dtype).newbyteorder("<")
        buffers[name] = np.frombuffer(content, little).reshape(shape)
    return Message(message_type, fields, buffers)


def _wire_array(name: str, array: np.ndarray) -> np.ndarray:
    if array.dtype.name not in DTYPES:
        raise WorkerError(f"buffer {name!r} is {array.dtype}; the wire carries {', '.join(DTYPES)}")
    # Contiguous, so that the stream takes it as it lies in memory.
    return np.ascontiguousarray(array, array.dtype.newbyteorder("<")).reshape(array.shape)


def _read(stream: BufferedIOBase, count: int, what: str, may_end: bool = False) -> bytes | None:
    """Exactly ``count`` bytes; None at a clean end where one is allowed."""
    chunks, missing = [], count
    while missing:
        chunk = stream.read(missing)
        if not chunk:
            if may_end and missing == count:
                return None
            raise WorkerError(
                f"the pipe closed inside a message: {what} has {count} bytes, "
                f"{count - missing} came; the other process ended early, see its log"
            )
        chunks.append(chunk)
        missing -= len(chunk)
    return b"".join(chunks)


def _parse_header(raw: bytes) -> tuple[str, dict, list[tuple[str, str, tuple[int, ...]]]]:
    try:
        header = json.loads(raw)
        message_type, fields, listed = header["type"], header["fields"], header["buffers"]
        entries = [(entry["name"], entry["dtype"], tuple(entry["shape"])) for entry in listed]
    except (ValueError, KeyError, TypeError) as error:
        raise WorkerError(
            f"a message header is not the expected JSON ({error!r}): {raw[:80]!r}"
        ) from error
    _check_type(message_type)
    if not isinstance(fields, dict):
        raise WorkerError(f"the fields of a {message_type!r} message are not a JSON object")
    for name, dtype, shape in entries:
        whole = all(type(extent) is int and extent >= 0 for extent in shape)
        if not isinstance(name, str) or dtype not in DTYPES or not whole:
            raise WorkerError(f"buffer {name!r} has dtype {dtype!r} and shape {shape!r}")
    if len({name for name, _, _ in entries}) < len(entries):
        raise WorkerError(f"a {message_type!r} message names a buffer twice")
    return message_type, fields, entries


def _check_type(message_type: object) -> None:
    if message_type not in (*REQUESTS, *REPLIES):
        raise WorkerError(
            f"unknown message type {message_type!r}; protocol {PROTOCOL} has "
            f"{', '.join((*REQUESTS, *REPLIES))}"
        )


def _check_size(header: int, buffers: int) -> None:
    if header > MAX_HEADER_BYTES or header + buffers > MAX_MESSAGE_BYTES:
        raise WorkerError(
            f"a message of {header + buffers} bytes (header {header}) is larger than the wire "
            f"takes ({MAX_MESSAGE_BYTES}, header {MAX_HEADER_BYTES}): send fewer frames at a time"
        )
