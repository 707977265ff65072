"""What travels between client and workers: plain data, checked where it arrives."""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ClusterError
from pe_runtime.state import EnvironmentState, state_as_dict, state_from_dict

Files = Mapping[str, bytes]
"""Contents of a frame's files by ending, such as ".png"."""


@dataclass(frozen=True)
class Job:
    """What all frames of a shot share."""

    versions: dict[str, str]
    """Of the programs whose arithmetic decides the pixels; the worker's must be the same."""
    model: str
    """Path of the model's file, where the client has it."""
    model_digest: str
    """SHA-256 of that file, in hex."""
    device: str
    quality: str
    depth: bool
    masks: tuple[str, ...]
    region: tuple[int, int, int, int] | None = None
    layers: tuple[str, ...] = ()
    background: bool = False
    threads: int | None = None
    """Threads to draw with; None for as many as the worker was given."""
    seconds: float = 10.0
    """A worker that has drawn for this long gives the other frames of its run back."""


@dataclass(frozen=True)
class FrameOrder:
    """One frame to draw."""

    number: int
    digest: str
    """What the files are to say of themselves."""
    state: EnvironmentState
    camera: Camera


@dataclass(frozen=True)
class Answer:
    """What became of a run."""

    worker: str
    """Who answers."""
    drawn: Mapping[int, Files] = dataclasses.field(default_factory=dict)
    """By frame number; frames of the run that are missing were not drawn."""
    failed: int | None = None
    """The frame that could not be drawn; those after it were not tried."""
    problem: str = ""
    """Why."""
    needs_model: bool = False
    """The worker does not have the model's file; nothing was drawn."""


def pack(job: Job, orders: Sequence[FrameOrder]) -> bytes:
    """A run of frames as JSON; floats survive exactly."""
    frames = [
        {
            "number": order.number,
            "digest": order.digest,
            "state": state_as_dict(order.state),
            "camera": order.camera.as_dict(),
        }
        for order in orders
    ]
    return json.dumps({"job": dataclasses.asdict(job), "frames": frames}).encode()


def unpack(parcel: bytes) -> tuple[Job, list[FrameOrder]]:
    """Read what `pack` wrote."""
    content = json.loads(parcel)
    job = content["job"]
    orders = [
        FrameOrder(
            each["number"],
            each["digest"],
            state_from_dict(each["state"]),
            Camera.from_dict(each["camera"]),
        )
        for each in content["frames"]
    ]
    region = job["region"] and tuple(job["region"])
    lists = {"masks": tuple(job["masks"]), "layers": tuple(job["layers"]), "region": region}
    return Job(**job | lists), orders


def answer_as_dict(answer: Answer) -> dict[str, Any]:
    """An answer without classes of ours, so that reading it needs none."""
    return vars(answer) | {"drawn": {n: dict(files) for n, files in answer.drawn.items()}}


def read_answer(value: object, run: Sequence[int], endings: Sequence[str]) -> Answer:
    """Check what a worker says it drew.

    Args:
        value: What `answer_as_dict` gave.
        run: Frames that it was asked for.
        endings: Files that each frame must have.

    Raises:
        ClusterError: It is no answer to this run.
    """
    if not (isinstance(value, dict) and _fits(value, run) and _holds(value["drawn"], endings)):
        raise ClusterError(
            f"a worker's answer for frames {run[0]}-{run[-1]} makes no sense; start all workers "
            "with the version of playable-environments that runs here"
        )
    return Answer(**value)


def _fits(value: dict, run: Sequence[int]) -> bool:
    if set(value) != {each.name for each in dataclasses.fields(Answer)}:
        return False
    texts = isinstance(value["worker"], str) and isinstance(value["problem"], str)
    named = isinstance(value["drawn"], dict) and set(value["drawn"]) <= set(run)
    whole = value["failed"] is None or value["failed"] in run
    # Else the same run would be asked for without end.
    tells = value["drawn"] or value["failed"] is not None or value["needs_model"] is True
    return bool(texts and named and whole and tells)


def _holds(drawn: Mapping[int, object], endings: Sequence[str]) -> bool:
    return all(
        isinstance(files, dict)
        and set(files) == set(endings)
        and all(isinstance(content, bytes) for content in files.values())
        for files in drawn.values()
    )
