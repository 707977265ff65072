"""What the worker answers, as values: frames, predicted paths and its reasons. No `bpy` here."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import WorkerError
from pe_runtime.contract.messages import CANCELLED, HEADING_PREFIX, Message
from pe_runtime.contract.shot import BACKGROUND_PASS, LAYER_PASS_PREFIX, MASK_PASS_PREFIX


@dataclass(frozen=True)
class RenderedFrame:
    """One frame as it came over the wire, top row first.

    Attributes:
        number: Scene frame.
        rgb: (height, width, 3) uint8, display-referred sRGB.
        depth: (height, width) float32 metres, +inf where nothing is; None if not asked for.
        masks: Per object (height, width) float32 in [0, 1].
        seconds: How long the worker drew.
        layers: Per object (height, width, 4) uint8 sRGB with straight alpha: the object alone.
        background: (height, width, 3) uint8 sRGB without playable objects; None if not asked for.
    """

    number: int
    rgb: np.ndarray
    depth: np.ndarray | None
    masks: Mapping[str, np.ndarray]
    seconds: float = 0.0
    layers: Mapping[str, np.ndarray] = field(default_factory=dict)
    background: np.ndarray | None = None


@dataclass(frozen=True)
class PredictedPaths:
    """Where the playable objects of a shot go, before the artist's changes; environment space.

    Attributes:
        positions: Per object (frames, 3) float64 metres.
        headings: Per object (frames,) float64 radians about z; only where the model predicts them.
    """

    positions: Mapping[str, np.ndarray]
    headings: Mapping[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True)
class MatchedCamera:
    """A camera that sees ground points where the artist put them.

    Attributes:
        camera: In environment space.
        residual: Root mean square of the distances to the points, pixels.
        worst: The largest of them, pixels.
    """

    camera: Camera
    residual: float
    worst: float


@dataclass(frozen=True)
class DetectedBoxes:
    """What a detector found in a picture.

    Attributes:
        boxes: By playable object left, top, right, bottom in pixels.
        scores: By playable object how sure it is, 0 to 1.
    """

    boxes: Mapping[str, tuple[float, float, float, float]]
    scores: Mapping[str, float]


class WorkerCancelledError(WorkerError):
    """The request was given up because its caller asked to stop."""


def error_from(reply: Message) -> WorkerError:
    """The reason of a failure, as the error to raise."""
    kind, text = reply.fields.get("kind", "unknown"), reply.fields.get("message", "")
    if kind == CANCELLED:
        return WorkerCancelledError(text or "cancelled")
    return WorkerError(f"{text} ({kind})")


def paths_from(reply: Message) -> PredictedPaths:
    """The answer to a rollout."""
    positions, headings = {}, {}
    for name, buffer in reply.buffers.items():
        if name.startswith(HEADING_PREFIX):
            headings[name.removeprefix(HEADING_PREFIX)] = buffer
        else:
            positions[name] = buffer
    return PredictedPaths(positions, headings)


def frame_from(reply: Message) -> RenderedFrame:
    """One drawn frame."""
    fields, buffers = reply.fields, reply.buffers
    return RenderedFrame(
        number=fields["number"],
        rgb=buffers["rgb"],
        depth=buffers.get("depth"),
        masks=_named_after(MASK_PASS_PREFIX, buffers),
        seconds=fields["seconds"],
        layers=_named_after(LAYER_PASS_PREFIX, buffers),
        background=buffers.get(BACKGROUND_PASS),
    )


def matched_from(reply: Message) -> MatchedCamera:
    """A matched camera."""
    found = reply.fields
    camera = Camera.from_dict(found["camera"], "matched camera")
    return MatchedCamera(camera, float(found["residual"]), float(found["worst"]))


def detected_from(reply: Message) -> DetectedBoxes:
    """The boxes that a detector found."""
    boxes = {name: tuple(map(float, box)) for name, box in reply.fields["boxes"].items()}
    scores = {name: float(score) for name, score in reply.fields["scores"].items()}
    return DetectedBoxes(boxes, scores)


def actions_from(reply: Message) -> dict[str, list[int]]:
    """The inferred actions of every object, in order."""
    return {name: list(map(int, actions)) for name, actions in reply.fields["actions"].items()}


def digests_from(reply: Message) -> dict[int, str]:
    """By frame the digest of all that decides its pixels."""
    return {int(frame): digest for frame, digest in reply.fields["digests"].items()}


def _named_after(prefix: str, buffers: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The buffers of one kind of pass by object name."""
    found = {n: each for n, each in buffers.items() if n.startswith(prefix)}
    return {name.removeprefix(prefix): each for name, each in found.items()}
