"""What is unusual about a picture's camera and boxes, said before anything is encoded.

A model has seen cameras, places and sizes of players within certain ranges. Outside of them it
still answers, but nobody should be surprised by how.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.envelope import Envelope
from pe_runtime.contract.model_facts import ModelFacts

from .box_limits import Box

BORDER = 0.5
"""Pixels from the picture's border within which a box counts as cut."""
SLACK = 1e-3
"""Share of a bound by which it may be passed: Blender keeps cameras in single precision."""
LEVEL = 1e-6
LEAST, LEAST_SHARE = 0.05, 0.005
"""Metres or degrees, and share, of an excess that would not be said as nothing."""


@dataclass(frozen=True)
class FramingWarning:
    """Something to know before encoding.

    Attributes:
        kind: `camera height`, `camera pitch`, `field of view`, `camera distance`, `position`,
            `box height`, `horizon` or `border`.
        object: The playable object's name; empty for the camera.
        text: What is unusual and by how much.
        impossible: Whether encoding will refuse it.
    """

    kind: str
    object: str
    text: str
    impossible: bool = False


def warnings_for(
    facts: ModelFacts | None,
    camera: Camera | None,
    boxes: Mapping[str, Box],
    picture_size: tuple[int, int],
) -> list[FramingWarning]:
    """Everything unusual about a picture, its camera and its boxes.

    Args:
        facts: The model's; None while no model is loaded.
        camera: In environment space, on the picture's pixels; None while nobody knows it.
        boxes: Per playable object that is in the picture.
        picture_size: Width and height in pixels.
    """
    envelope = facts.envelope if facts else None
    feet = {} if camera is None else {name: foot_of(camera, box) for name, box in boxes.items()}
    found = [warning for name, foot in feet.items() for warning in _about_feet(name, foot)]
    found += [
        each for name, box in boxes.items() for each in _about_border(name, box, picture_size)
    ]
    if envelope is not None:
        standing = {name: foot for name, foot in feet.items() if foot is not None}
        if camera is not None:
            found += _about_camera(envelope, camera, list(standing.values()))
        found += [each for n, foot in standing.items() for each in _about_place(envelope, n, foot)]
        for name, (_, top, _, bottom) in boxes.items():
            share = (bottom - top) / picture_size[1]
            found += _outside("box height", name, share, envelope.box_heights)
    return found


def foot_of(camera: Camera, box: Box) -> tuple[float, float] | None:
    """Where the middle of a box's lower edge meets the ground, (x, y) metres; None: nowhere."""
    return on_ground(camera, (box[0] + box[2]) / 2, box[3])


def on_ground(camera: Camera, u: float, v: float) -> tuple[float, float] | None:
    """The place on the ground (x, y) that a pixel shows, metres; None at or above the horizon."""
    fx, fy = camera.intrinsics[0, 0], camera.intrinsics[1, 1]
    cx, cy = camera.intrinsics[:2, 2]
    ray = camera.world_from_camera[:3, :3] @ np.array([(u - cx) / fx, (v - cy) / fy, 1.0])
    eye = camera.world_from_camera[:3, 3]
    # A camera below the ground sees it from the other side, where nobody stands.
    if eye[2] <= 0 or ray[2] >= -LEVEL * np.linalg.norm(ray):
        return None
    x, y, _ = eye - ray * (eye[2] / ray[2])
    return float(x), float(y)


def _about_feet(name: str, foot: tuple[float, float] | None) -> Iterator[FramingWarning]:
    if foot is None:
        yield FramingWarning(
            "horizon",
            name,
            f"{name}: the lower edge of the box is at or above the horizon, where no ground is; "
            "draw it down to the feet or correct the camera",
            impossible=True,
        )


def _about_border(name: str, box: Box, size: tuple[int, int]) -> Iterator[FramingWarning]:
    left, top, right, bottom = box
    near = {
        "left": left <= BORDER,
        "upper": top <= BORDER,
        "right": right >= size[0] - BORDER,
        "lower": bottom >= size[1] - BORDER,
    }
    if sides := [side for side, is_near in near.items() if is_near]:
        feet = "; the feet may be out of sight" if "lower" in sides else ""
        text = f"{name}: the box touches the {' and '.join(sides)} border of the picture{feet}"
        yield FramingWarning("border", name, text)


def _about_camera(
    envelope: Envelope, camera: Camera, feet: Sequence[tuple[float, float]]
) -> Iterator[FramingWarning]:
    eye, ahead = camera.world_from_camera[:3, 3], camera.world_from_camera[:3, 2]
    pitch = math.degrees(math.asin(float(np.clip(ahead[2], -1.0, 1.0))))
    yield from _outside("camera height", "", float(eye[2]), envelope.camera_heights)
    yield from _outside("camera pitch", "", pitch, envelope.camera_pitches)
    yield from _outside("field of view", "", field_of_view(camera), envelope.fields_of_view)
    if feet:
        middle = np.array([*np.mean(feet, axis=0), 0.0])
        distance = float(np.linalg.norm(eye - middle))
        yield from _outside("camera distance", "", distance, envelope.camera_distances)


def field_of_view(camera: Camera) -> float:
    """How much a camera sees from its left to its right border, degrees."""
    focal, middle = camera.intrinsics[0, 0], camera.intrinsics[0, 2]
    return math.degrees(math.atan(middle / focal) + math.atan((camera.width - middle) / focal))


def _about_place(
    envelope: Envelope, name: str, foot: tuple[float, float]
) -> Iterator[FramingWarning]:
    low, high = envelope.positions
    beyond = [_beyond(value, span) for value, *span in zip(foot, low, high, strict=True)]
    if math.hypot(*beyond) >= LEAST:
        text = (
            f"{name} stands at ({foot[0]:.1f}, {foot[1]:.1f}) m, {math.hypot(*beyond):.1f} m "
            f"outside of the ground that the model knows: x {low[0]:.1f} to {high[0]:.1f}, "
            f"y {low[1]:.1f} to {high[1]:.1f}"
        )
        yield FramingWarning("position", name, text)


SAYINGS = {
    "camera height": ("the camera is {:.1f} m above the ground", "{:.1f} to {:.1f} m"),
    "camera distance": ("the camera is {:.1f} m from the players", "{:.1f} to {:.1f} m"),
    "camera pitch": ("the camera looks {:+.1f}° from the horizon", "{:+.1f}° to {:+.1f}°"),
    "field of view": ("the camera sees {:.1f}° from side to side", "{:.1f}° to {:.1f}°"),
    "box height": ("the box is {:.0%} of the picture's height", "{:.0%} to {:.0%}"),
}
"""Per kind: how a value is said, and the range that the model knows."""
EXCESSES = {"camera height": "{:.1f} m", "camera distance": "{:.1f} m", "box height": "{:.0%}"}


def _outside(
    kind: str, name: str, value: float, span: tuple[float, float]
) -> Iterator[FramingWarning]:
    beyond = _beyond(value, span)
    if abs(beyond) >= (LEAST_SHARE if kind == "box height" else LEAST):
        said, known = SAYINGS[kind]
        excess = EXCESSES.get(kind, "{:.1f}°").format(abs(beyond))
        way = "too much" if beyond > 0 else "too little"
        who = f"{name}: " if name else ""
        text = f"{who}{said.format(value)}, {excess} {way}: the model knows {known.format(*span)}"
        yield FramingWarning(kind, name, text)


def _beyond(value: float, span: tuple[float, float]) -> float:
    """How far a value lies outside of a range: negative below, positive above, 0 inside."""
    low, high = span
    slack = SLACK * max(1.0, abs(low), abs(high))
    if low - slack <= value <= high + slack:
        return 0.0
    return value - low if value < low else value - high
