"""What ``ready`` tells about a loaded model: all that Blender must know of it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .camera import Camera
from .envelope import Envelope
from .errors import CameraError, WorkerError

Movement = tuple[float, float]
"""Metres to the right and ahead in one model step, along the ground in the camera's frame."""
Point = tuple[float, float, float]


@dataclass(frozen=True)
class Volume:
    """The box in which an object is drawn, around its origin; metres along the object's axes."""

    low: Point
    high: Point

    def __post_init__(self) -> None:
        numbers = (*self.low, *self.high)
        if len(self.low) != 3 or len(self.high) != 3 or not all(map(math.isfinite, numbers)):
            raise ValueError(f"a volume has two corners of three finite numbers, not {numbers}")


@dataclass(frozen=True)
class ModelFacts:
    """One loaded model, as the add-on sees it."""

    name: str
    action_names: Mapping[str, tuple[str, ...]]
    """Per playable object, in model order: the names of its actions; an index is a position. Empty
    where the model has none for it."""
    steps_per_second: float
    width: int
    height: int
    """Width and height in pixels of the pictures that the model was made for."""
    resting_actions: Mapping[str, int] = field(default_factory=dict)
    """Per playable object with actions: the action of one that nobody plays."""
    turning_names: tuple[str, ...] = ()
    """Playable objects whose heading the model sees or predicts; others keep the world's axes."""
    volumes: Mapping[str, Volume] = field(default_factory=dict)
    """Per object but the sky, static ones too."""
    usual_camera: Camera | None = None
    """Where its pictures are usually taken from, environment space; None where nobody knows."""
    licence: str = ""
    """Terms of the weights where they are not the program's own."""
    movements: Mapping[str, tuple[Movement, ...]] = field(default_factory=dict)
    """Per playable object: how each of its actions moves it; empty where nobody knows."""
    envelope: Envelope | None = None
    """What the model was trained on; None where nobody knows."""
    detects: bool = False
    """Whether the runtime can find playable objects in a picture."""
    device: str = ""
    """Where the runtime computes, in words."""
    digest: str = ""
    """SHA-256 of the weights, in hex."""

    @property
    def playable_names(self) -> tuple[str, ...]:
        """Names of the playable objects, in model order."""
        return tuple(self.action_names)

    def as_fields(self) -> dict[str, Any]:
        """Fields of a ``ready`` message."""
        camera = self.usual_camera
        return {
            "name": self.name,
            "action_names": {name: list(names) for name, names in self.action_names.items()},
            "playable_names": list(self.action_names),
            "steps_per_second": self.steps_per_second,
            "width": self.width,
            "height": self.height,
            "resting_actions": dict(self.resting_actions),
            "turning_names": list(self.turning_names),
            "volumes": {n: [list(each.low), list(each.high)] for n, each in self.volumes.items()},
            "usual_camera": None if camera is None else camera.as_dict(),
            "licence": self.licence,
            "movements": {n: [list(each) for each in own] for n, own in self.movements.items()},
            "envelope": None if self.envelope is None else self.envelope.as_dict(),
            "detects": self.detects,
            "device": self.device,
            "digest": self.digest,
        }

    @staticmethod
    def from_fields(fields: Mapping[str, Any]) -> "ModelFacts":
        """Read the fields of a ``ready`` message.

        Raises:
            WorkerError: A fact is missing or of the wrong kind.
        """
        try:
            names, camera = fields["playable_names"], fields["usual_camera"]
            envelope = fields["envelope"]
            return ModelFacts(
                name=str(fields["name"]),
                action_names={name: tuple(fields["action_names"][name]) for name in names},
                steps_per_second=float(fields["steps_per_second"]),
                width=int(fields["width"]),
                height=int(fields["height"]),
                resting_actions={n: int(each) for n, each in fields["resting_actions"].items()},
                turning_names=tuple(map(str, fields["turning_names"])),
                volumes={name: _volume_from(each) for name, each in fields["volumes"].items()},
                usual_camera=None if camera is None else Camera.from_dict(camera, "usual_camera"),
                licence=str(fields["licence"]),
                movements={n: _movements_from(own) for n, own in fields["movements"].items()},
                envelope=None if envelope is None else Envelope.from_dict(envelope),
                detects=bool(fields["detects"]),
                device=str(fields["device"]),
                digest=str(fields["digest"]),
            )
        except (KeyError, TypeError, ValueError, AttributeError, CameraError) as error:
            raise WorkerError(
                f"the worker's facts about its model are incomplete ({error!r}): "
                f"found {sorted(fields)}; use an add-on and a runtime of the same version"
            ) from error


def _volume_from(corners: Any) -> Volume:  # noqa: ANN401 a JSON value
    low, high = corners
    return Volume(tuple(map(float, low)), tuple(map(float, high)))


def _movements_from(listed: Any) -> tuple[Movement, ...]:  # noqa: ANN401 a JSON value
    return tuple((float(right), float(ahead)) for right, ahead in listed)
