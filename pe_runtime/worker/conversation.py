"""What the worker answers to each request of one connection."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

import pe_runtime
from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ShotError, WorkerError
from pe_runtime.contract.messages import PROTOCOL, REQUESTS, Message
from pe_runtime.contract.shot import Shot
from pe_runtime.contract.shot_values import read_number, read_row, read_text
from pe_runtime.worker.world import World


@dataclass(frozen=True)
class Call:
    """One request with what its handler needs beside the world."""

    fields: Mapping[str, Any]
    buffers: Mapping[str, np.ndarray]
    send: Callable[[Message], None]
    is_cancelled: Callable[[], bool]


class RequestCancelledError(Exception):
    """Leaves a handler whose request was cancelled."""


class Conversation:
    """What one connection has said so far, and the answers to what it may say."""

    def __init__(self, make_world: Callable[[], World]) -> None:
        self._make_world = make_world
        self._greeted = False
        self._world: World | None = None
        self._model = ""
        self._whole: Shot | None = None

    def answer(self, request: Message, call: Call) -> Message:
        """The terminal reply."""
        answers = {
            "hello": self._hello,
            "load": self._load,
            "encode": self._encode,
            "rollout": self._rollout,
            "prepare": self._prepare,
            "render": self._render,
            "digests": self._digests,
            "infer_actions": self._infer_actions,
            "match_camera": self._match_camera,
            "detect": self._detect,
            "proxy_mesh": self._proxy_mesh,
        }
        if request.type not in answers:
            raise WorkerError(f"{request.type!r} is no request; expected {', '.join(REQUESTS)}")
        if request.type != "hello" and not self._greeted:
            raise WorkerError(f"{request.type!r} came before hello; send hello first")
        return answers[request.type](call)

    def _hello(self, call: Call) -> Message:
        own = {"protocol": PROTOCOL, "version": pe_runtime.__version__}
        for name, mine in own.items():
            if call.fields.get(name) != mine:
                raise WorkerError(
                    f"the other side speaks {name} {call.fields.get(name)!r}, this worker "
                    f"{mine!r}; install the add-on and the runtime in the same version"
                )
        self._greeted = True
        return Message("ready", own)

    def _load(self, call: Call) -> Message:
        model = _field(call, "model", str)
        world = self._make_world()
        facts = world.load(model)
        self._world, self._model, self._whole = world, model, None
        return Message("ready", facts.as_fields())

    def _encode(self, call: Call) -> Message:
        image = _image(call, "encode")
        camera = Camera.from_dict(_field(call, "camera", dict), "encode.camera")
        listed = _field(call, "boxes", dict)
        boxes = {name: read_row(box, f"encode.boxes[{name!r}]", 4) for name, box in listed.items()}
        state = self._loaded().encode(image, camera, boxes)
        return Message("state", {"state": state})

    def _rollout(self, call: Call) -> Message:
        shot = self._shot(call)
        return Message("state", {"fps": shot.fps}, self._loaded().rollout(shot))

    def _prepare(self, call: Call) -> Message:
        self._whole, whole = None, self._shot(call)
        self._loaded().rollout(whole)
        self._whole = whole
        return Message("ready")

    def _render(self, call: Call) -> Message:
        shot = self._shot(call)
        frames = _wanted_frames(shot, call.fields.get("frames"))
        within = (self._whole_of(shot),) if call.fields.get("take") else ()
        pictures, total = self._loaded().render(shot, frames, *within), len(frames)
        for done in range(total):
            if call.is_cancelled():
                raise RequestCancelledError(f"cancelled after {done} of {total} frames")
            picture = next(pictures)
            fields = {"number": picture.number, "seconds": picture.seconds}
            call.send(Message("frame", fields, picture.buffers))
            call.send(Message("progress", {"stage": "render", "done": done + 1, "total": total}))
        return Message("ready", {"frames": total})

    def _digests(self, call: Call) -> Message:
        shot = self._shot(call)
        within = (self._whole_of(shot),) if call.fields.get("take") else ()
        digests = self._loaded().digests(shot, *within)
        return Message("state", {"digests": {str(frame): each for frame, each in digests.items()}})

    def _infer_actions(self, call: Call) -> Message:
        states, listed = _field(call, "states", list), _field(call, "cameras", list)
        if len(states) != len(listed) or not states:
            raise WorkerError(
                f"infer_actions needs one camera per state, found {len(states)} states and "
                f"{len(listed)} cameras"
            )
        cameras = [
            Camera.from_dict(each, f"infer_actions.cameras[{i}]") for i, each in enumerate(listed)
        ]
        return Message("state", {"actions": self._loaded().infer_actions(states, cameras)})

    def _detect(self, call: Call) -> Message:
        image, names = _image(call, "detect"), _field(call, "names", list)
        found = self._loaded().detect(image, [read_text(name, "detect.names") for name in names])
        boxes = {name: [float(edge) for edge in box] for name, (box, _) in found.items()}
        scores = {name: float(score) for name, (_, score) in found.items()}
        return Message("state", {"boxes": boxes, "scores": scores})

    def _match_camera(self, call: Call) -> Message:
        # Late: OpenCV is no part of a worker's start.
        from pe_runtime.footage.ground_points import match_camera

        size = _field(call, "width", int), _field(call, "height", int)
        focal = call.fields.get("focal")
        found = match_camera(
            size,
            _field(call, "points", list),
            None if focal is None else read_number(focal, "match_camera.focal"),
        )
        fields = {"residual": found.residual, "worst": found.worst}
        return Message("state", fields | {"camera": found.camera.as_dict()})

    def _proxy_mesh(self, call: Call) -> Message:
        vertices, faces = self._loaded().proxy_mesh(_field(call, "object", str))
        return Message("state", {}, {"vertices": vertices, "faces": faces})

    def _whole_of(self, take: Shot) -> Shot:
        """The prepared shot, if the take can be a part of it."""
        whole = self._whole
        if whole is None:
            raise WorkerError(
                "no shot is prepared that this could be a take of; send prepare first"
            )
        known = {track.name for track in whole.objects}
        named = {track.name for track in take.objects}
        if not set(take.frames) <= set(whole.frames) or not named <= known:
            raise ShotError(
                f"a take of the prepared shot has frames of {whole.frame_start} to "
                f"{whole.frame_end} and objects of {sorted(known)}, found frames "
                f"{take.frame_start} to {take.frame_end} and objects {sorted(named)}"
            )
        return whole

    def _loaded(self) -> World:
        if self._world is None:
            raise WorkerError("no model is loaded; send load first")
        return self._world

    def _shot(self, call: Call) -> Shot:
        self._loaded()
        shot = Shot.from_dict(_field(call, "shot", dict))
        if shot.model != self._model:
            raise WorkerError(
                f"the shot asks for the model {shot.model!r}, loaded is {self._model!r}; "
                "send load first"
            )
        return shot


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


def _field(call: Call, name: str, kind: type) -> Any:  # noqa: ANN401
    value = call.fields.get(name)
    if not isinstance(value, kind):
        raise WorkerError(f"the field {name!r} must be a {kind.__name__}, found {value!r:.100}")
    return value


def _image(call: Call, request: str) -> np.ndarray:
    if "image" not in call.buffers:
        raise WorkerError(f"{request} needs a buffer 'image'; found {list(call.buffers)}")
    image = call.buffers["image"]
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        raise WorkerError(
            f"{request} needs an image of uint8 (height, width, 3), found {image.dtype} "
            f"{image.shape}"
        )
    return image
