"""The parts of a Shot: where it starts, and what each of its objects does."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .camera import Camera
from .shot_values import (
    read_integer,
    read_keys,
    read_list,
    read_number,
    read_optional_text,
    read_row,
    read_text,
    refuse,
)

Point = tuple[float, float, float]
Box = tuple[float, float, float, float]
WEIGHT_TOLERANCE = 1e-6
OPTIONAL_KEYS = ("actions", "locations", "visible", "styles", "headings", "poses")


@dataclass(frozen=True)
class Start:
    """Where a shot begins: a picture to encode (image, camera, boxes), or a stored state."""

    image: str | None = None
    """Path of the picture."""
    camera: Camera | None = None
    """The camera that saw the picture."""
    boxes: Mapping[str, Box] = field(default_factory=dict)
    """Per playable object seen in the picture: left, top, right, bottom in its pixels."""
    state: str | None = None
    """Path of a state JSON file, instead of the three above."""

    def __post_init__(self) -> None:
        if self.state is not None:
            if self.image is not None or self.camera is not None or self.boxes:
                refuse("start", "either a state or image, camera and boxes", "both")
        elif self.image is None or self.camera is None:
            refuse("start", "image and camera, or state", "an incomplete picture")
        for name, box in self.boxes.items():
            if len(box) != 4 or not all(map(math.isfinite, box)):
                refuse(f"start.boxes[{name!r}]", "left, top, right, bottom in pixels", box)

    def as_dict(self) -> dict[str, Any]:
        """The start as plain JSON values."""
        return {
            "image": self.image,
            "camera": self.camera.as_dict() if self.camera else None,
            "boxes": {name: [float(edge) for edge in box] for name, box in self.boxes.items()},
            "state": self.state,
        }

    @staticmethod
    def from_dict(content: object, where: str = "start") -> "Start":
        """Read what ``as_dict`` wrote; keys may be missing where they are null."""
        keys = read_keys(content, where, (), ("image", "camera", "boxes", "state"))
        camera, boxes = keys.get("camera"), keys.get("boxes") or {}
        if not isinstance(boxes, dict):
            refuse(f"{where}.boxes", "boxes by object name", boxes)
        return Start(
            image=read_optional_text(keys.get("image"), f"{where}.image"),
            camera=None if camera is None else Camera.from_dict(camera, f"{where}.camera"),
            boxes={
                name: read_row(box, f"{where}.boxes[{name!r}]", 4) for name, box in boxes.items()
            },
            state=read_optional_text(keys.get("state"), f"{where}.state"),
        )


@dataclass(frozen=True)
class StyleMix:
    """From ``frame`` on, ``weight`` of the object's style comes from another object's."""

    frame: int
    image: str | None
    """State file whose object lends its style; None for the shot's own start."""
    object: str
    """Name of the lending object in that state."""
    weight: float
    """0 keeps the own style, 1 takes the other's."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.weight <= 1.0:
            refuse("styles.weight", "a number from 0 to 1", self.weight)

    def as_dict(self) -> dict[str, Any]:
        """The mix as plain JSON values."""
        return {
            "frame": self.frame,
            "image": self.image,
            "object": self.object,
            "weight": float(self.weight),
        }

    @staticmethod
    def from_dict(content: object, where: str = "style") -> "StyleMix":
        """Read what ``as_dict`` wrote."""
        keys = read_keys(content, where, ("frame", "object", "weight"), ("image",))
        return StyleMix(
            frame=read_integer(keys["frame"], f"{where}.frame"),
            image=read_optional_text(keys.get("image"), f"{where}.image"),
            object=read_text(keys["object"], f"{where}.object"),
            weight=read_number(keys["weight"], f"{where}.weight"),
        )


@dataclass(frozen=True)
class PoseKey:
    """From ``frame`` on, the object's pose is the one predicted for another frame."""

    frame: int
    held: int | None
    """Scene frame whose predicted pose is held; None lets the pose move freely again."""


@dataclass(frozen=True)
class ObjectTrack:
    """What one object does during the shot."""

    name: str
    actions: tuple[tuple[int, int], ...] = ()
    """Keys (frame, action index), each held until the next one."""
    locations: tuple[Point, ...] | None = None
    """One location per frame in environment space, metres, in place of the predicted ones."""
    visible: tuple[bool, ...] | None = None
    """One switch per frame; None means always."""
    styles: tuple[StyleMix, ...] = ()
    headings: tuple[float, ...] | None = None
    """One turn about world z per frame, radians, in place of the predicted ones."""
    poses: tuple[PoseKey, ...] = ()
    """Keys that hold and free the pose; before the first one it is free."""

    def __post_init__(self) -> None:
        where = f"objects[{self.name!r}]"
        if not self.name:
            refuse("objects.name", "a name", self.name)
        _check_rising(f"{where}.actions", [frame for frame, _ in self.actions])
        _check_rising(f"{where}.poses", [key.frame for key in self.poses])
        if any(action < 0 for _, action in self.actions):
            refuse(f"{where}.actions", "action indices of 0 or more", self.actions)
        for index, point in enumerate(self.locations or ()):
            if len(point) != 3 or not all(map(math.isfinite, point)):
                refuse(f"{where}.locations[{index}]", "three finite numbers", point)
        for index, heading in enumerate(self.headings or ()):
            if not math.isfinite(heading):
                refuse(f"{where}.headings[{index}]", "a finite number of radians", heading)
        for frame in {mix.frame for mix in self.styles}:
            weight = sum(mix.weight for mix in self.styles if mix.frame == frame)
            if weight > 1.0 + WEIGHT_TOLERANCE:
                refuse(f"{where}.styles", f"weights of at most 1 at frame {frame}", weight)

    def action_at(self, frame: int) -> int | None:
        """Action held at a frame: the last key's, before the first key the first's."""
        if not self.actions:
            return None
        held = [action for key, action in self.actions if key <= frame]
        return held[-1] if held else self.actions[0][1]

    def styles_at(self, frame: int) -> tuple[StyleMix, ...]:
        """Style mixes in force at a frame: all those of the last styled frame up to it."""
        latest = max((mix.frame for mix in self.styles if mix.frame <= frame), default=None)
        return tuple(mix for mix in self.styles if mix.frame == latest)

    def pose_at(self, frame: int) -> int | None:
        """Scene frame whose predicted pose is held at a frame; None where the pose is free."""
        held = [key.held for key in self.poses if key.frame <= frame]
        return held[-1] if held else None

    def as_dict(self) -> dict[str, Any]:
        """The track as plain JSON values."""
        points, switches = self.locations, self.visible
        # Left out where there are none: documents and digests stay those of earlier versions.
        turns = {} if self.headings is None else {"headings": [float(x) for x in self.headings]}
        poses = {"poses": [[key.frame, key.held] for key in self.poses]} if self.poses else {}
        return {
            "name": self.name,
            "actions": [[frame, action] for frame, action in self.actions],
            "locations": None if points is None else [[float(x) for x in row] for row in points],
            "visible": None if switches is None else [bool(switch) for switch in switches],
            "styles": [mix.as_dict() for mix in self.styles],
            **turns,
            **poses,
        }

    @staticmethod
    def from_dict(content: object, where: str = "object") -> "ObjectTrack":
        """Read what ``as_dict`` wrote; all but the name may be missing."""
        keys = read_keys(content, where, ("name",), OPTIONAL_KEYS)
        points, styles = keys.get("locations"), read_list(keys.get("styles", []), f"{where}.styles")
        if points is not None:
            points = read_list(points, f"{where}.locations")
            points = tuple(
                read_row(row, f"{where}.locations[{index}]", 3) for index, row in enumerate(points)
            )
        return ObjectTrack(
            name=read_text(keys["name"], f"{where}.name"),
            actions=_read_actions(keys.get("actions", []), f"{where}.actions"),
            locations=points,
            visible=_read_switches(keys.get("visible"), f"{where}.visible"),
            styles=tuple(
                StyleMix.from_dict(mix, f"{where}.styles[{i}]") for i, mix in enumerate(styles)
            ),
            headings=_read_headings(keys.get("headings"), f"{where}.headings"),
            poses=_read_poses(keys.get("poses", []), f"{where}.poses"),
        )


def _check_rising(where: str, frames: list[int]) -> None:
    if any(later <= earlier for earlier, later in zip(frames, frames[1:], strict=False)):
        refuse(where, "keys in strictly increasing frames", frames)


def _read_actions(content: object, where: str) -> tuple[tuple[int, int], ...]:
    keys = []
    for index, key in enumerate(read_list(content, where)):
        if len(read_list(key, f"{where}[{index}]")) != 2:
            refuse(f"{where}[{index}]", "a frame and an action index", key)
        keys.append(tuple(read_integer(value, f"{where}[{index}]") for value in key))
    return tuple(keys)


def _read_headings(content: object, where: str) -> tuple[float, ...] | None:
    if content is None:
        return None
    return tuple(
        read_number(each, f"{where}[{i}]") for i, each in enumerate(read_list(content, where))
    )


def _read_poses(content: object, where: str) -> tuple[PoseKey, ...]:
    keys = []
    for index, key in enumerate(read_list(content, where)):
        if len(read_list(key, f"{where}[{index}]")) != 2:
            refuse(f"{where}[{index}]", "a frame and the frame whose pose is held, or null", key)
        frame, held = key
        at = f"{where}[{index}]"
        keys.append(
            PoseKey(read_integer(frame, at), None if held is None else read_integer(held, at))
        )
    return tuple(keys)


def _read_switches(content: object, where: str) -> tuple[bool, ...] | None:
    if content is None:
        return None
    switches = tuple(read_list(content, where))
    if not all(isinstance(switch, bool) for switch in switches):
        refuse(where, "true or false per frame", switches)
    return switches
