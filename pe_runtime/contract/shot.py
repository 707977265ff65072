"""A Shot: everything one rendering job asks for, frame by frame, as one JSON document.

The add-on writes Shots, the command line runs them, a farm splits them, tests compare them.
Positions and cameras are in environment space: right-handed, Z up, metres.
"""

import hashlib
import json
import math
from dataclasses import dataclass
from typing import Any

from .camera import Camera
from .errors import CameraError, ShotError
from .shot_track import ObjectTrack, PoseKey, Start, StyleMix
from .shot_values import read_integer, read_keys, read_list, read_number, read_text, refuse

__all__ = ["QUALITIES", "SHOT_VERSION", "ObjectTrack", "PoseKey", "Shot", "Start", "StyleMix"]

SHOT_VERSION = 1
QUALITIES = ("exact", "balanced", "draft")
DEPTH_PASS = "depth"
MASK_PASS_PREFIX = "mask:"
LAYER_PASS_PREFIX = "layer:"
BACKGROUND_PASS = "background"
KNOWN_PASSES = (DEPTH_PASS, BACKGROUND_PASS, MASK_PASS_PREFIX, LAYER_PASS_PREFIX)
REQUIRED_KEYS = ("version", "model", "start", "fps", "frame_start", "frame_end", "cameras")
OPTIONAL_KEYS = ("objects", "quality", "passes", "region")

Region = tuple[int, int, int, int]
"""Left, top, width, height in pixels."""


@dataclass(frozen=True)
class Shot:
    """One rendering job. Two shots are the same job when their digests are equal."""

    version: int
    model: str
    """Name of a built-in model, or path of a checkpoint."""
    start: Start
    fps: float
    frame_start: int
    frame_end: int
    """Last frame, inclusive."""
    cameras: tuple[Camera, ...]
    """One per frame, all of one size."""
    objects: tuple[ObjectTrack, ...] = ()
    quality: str = "exact"
    passes: tuple[str, ...] = ()
    """Beside the picture: ``depth``, ``mask:<object>``, ``layer:<object>``, ``background``."""
    region: Region | None = None
    """The only part of the cameras' grid that is drawn; None for all of it."""

    def __post_init__(self) -> None:
        if self.version != SHOT_VERSION:
            refuse("version", f"{SHOT_VERSION}, the version this program reads", self.version)
        if not self.model:
            refuse("model", "a model's name or path", self.model)
        if not (math.isfinite(self.fps) and self.fps > 0):
            refuse("fps", "a finite number above 0", self.fps)
        if self.frame_end < self.frame_start:
            refuse("frame_end", f"{self.frame_start} (frame_start) or later", self.frame_end)
        self._check_lengths()
        self._check_choices()
        self._check_region()

    def _check_lengths(self) -> None:
        lengths = {"cameras": self.cameras}
        for track in self.objects:
            lengths[f"objects[{track.name!r}].locations"] = track.locations
            lengths[f"objects[{track.name!r}].visible"] = track.visible
            lengths[f"objects[{track.name!r}].headings"] = track.headings
        for key, per_frame in lengths.items():
            if per_frame is not None and len(per_frame) != len(self.frames):
                refuse(key, f"{len(self.frames)} entries, one per frame", len(per_frame))
        sizes = sorted({(camera.width, camera.height) for camera in self.cameras})
        if len(sizes) > 1:
            refuse("cameras", "one picture size for the whole shot", sizes)

    def _check_choices(self) -> None:
        names = [track.name for track in self.objects]
        if len(set(names)) < len(names):
            refuse("objects", "each object once", names)
        if self.quality not in QUALITIES:
            refuse("quality", f"one of {', '.join(QUALITIES)}", self.quality, QUALITIES)
        for name in self.passes:
            of_object = any(
                name.startswith(prefix) and name != prefix
                for prefix in (MASK_PASS_PREFIX, LAYER_PASS_PREFIX)
            )
            if name not in (DEPTH_PASS, BACKGROUND_PASS) and not of_object:
                expected = f"{DEPTH_PASS!r}, {BACKGROUND_PASS!r}, 'mask:<object>', 'layer:<object>'"
                refuse("passes", f"one of {expected}", name, KNOWN_PASSES)
        if len(set(self.passes)) < len(self.passes):
            refuse("passes", "each pass once", self.passes)

    def _check_region(self) -> None:
        if self.region is None:
            return
        whole, (left, top, width, height) = self.cameras[0], self.region
        if width < 1 or height < 1:
            refuse("region", "a width and a height of at least one pixel", self.region)
        inside = left >= 0 and top >= 0
        if not (inside and left + width <= whole.width and top + height <= whole.height):
            found = f"left {left}, top {top}, width {width}, height {height}"
            refuse("region", f"a part of the {whole.width}x{whole.height} pixels", found)

    @property
    def frames(self) -> range:
        """All frame numbers of the shot."""
        return range(self.frame_start, self.frame_end + 1)

    @property
    def wants_depth(self) -> bool:
        """Whether the depth pass is asked for."""
        return DEPTH_PASS in self.passes

    @property
    def mask_names(self) -> tuple[str, ...]:
        """Objects whose mask is asked for."""
        return self._named_after(MASK_PASS_PREFIX)

    @property
    def layer_names(self) -> tuple[str, ...]:
        """Objects whose layer is asked for."""
        return self._named_after(LAYER_PASS_PREFIX)

    @property
    def wants_background(self) -> bool:
        """Whether the picture without playable objects is asked for."""
        return BACKGROUND_PASS in self.passes

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels of what is drawn: the region's, or the cameras'."""
        if self.region is not None:
            return self.region[2:]
        return self.cameras[0].width, self.cameras[0].height

    def _named_after(self, prefix: str) -> tuple[str, ...]:
        names = (name for name in self.passes if name.startswith(prefix))
        return tuple(name.removeprefix(prefix) for name in names)

    def track(self, name: str) -> ObjectTrack | None:
        """The track of an object, if the shot has one."""
        return next((track for track in self.objects if track.name == name), None)

    def action_at(self, name: str, frame: int) -> int | None:
        """Action index an object holds at a frame; None where the shot keys none for it."""
        track = self.track(name)
        return track.action_at(frame) if track else None

    def camera_at(self, frame: int) -> Camera:
        """Camera of a frame.

        Raises:
            ShotError: The frame is outside the shot.
        """
        if frame not in self.frames:
            refuse("frame", f"a frame from {self.frame_start} to {self.frame_end}", frame)
        return self.cameras[frame - self.frame_start]

    def as_dict(self) -> dict[str, Any]:
        """The shot as plain JSON values."""
        # Left out where there is none: documents and digests stay those of earlier versions.
        region = {} if self.region is None else {"region": list(self.region)}
        return region | {
            "version": self.version,
            "model": self.model,
            "start": self.start.as_dict(),
            "fps": float(self.fps),
            "frame_start": self.frame_start,
            "frame_end": self.frame_end,
            "cameras": [camera.as_dict() for camera in self.cameras],
            "objects": [track.as_dict() for track in self.objects],
            "quality": self.quality,
            "passes": list(self.passes),
        }

    def to_json(self) -> str:
        """The shot as indented JSON text."""
        return json.dumps(self.as_dict(), indent=1, allow_nan=False)

    @staticmethod
    def from_dict(content: object, where: str = "shot") -> "Shot":
        """Read a shot from the values of ``as_dict``; errors as ``from_json``."""
        try:
            return _read_shot(content)
        except (ShotError, CameraError) as error:
            raise ShotError(f"{where}: {error}") from error

    @staticmethod
    def from_json(text: str, where: str = "shot") -> "Shot":
        """Read a shot from JSON text.

        Args:
            text: The document.
            where: Its name in error messages, such as the file's path.

        Raises:
            ShotError: Anything missing, unknown, of the wrong kind or not finite.
        """
        try:
            content = json.loads(text)
        except ValueError as error:
            raise ShotError(f"{where}: not a JSON document ({error})") from error
        return Shot.from_dict(content, where)

    def digest(self) -> str:
        """SHA-256 of the shot's canonical JSON, in hex."""
        canonical = json.dumps(self.as_dict(), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(canonical.encode()).hexdigest()


def _read_shot(content: object) -> Shot:
    keys = read_keys(content, "top level", REQUIRED_KEYS, OPTIONAL_KEYS)
    cameras = read_list(keys["cameras"], "cameras")
    tracks = read_list(keys.get("objects", []), "objects")
    passes = read_list(keys.get("passes", []), "passes")
    return Shot(
        version=read_integer(keys["version"], "version"),
        model=read_text(keys["model"], "model"),
        start=Start.from_dict(keys["start"]),
        fps=read_number(keys["fps"], "fps"),
        frame_start=read_integer(keys["frame_start"], "frame_start"),
        frame_end=read_integer(keys["frame_end"], "frame_end"),
        cameras=tuple(Camera.from_dict(item, f"cameras[{i}]") for i, item in enumerate(cameras)),
        objects=tuple(
            ObjectTrack.from_dict(item, f"objects[{i}]") for i, item in enumerate(tracks)
        ),
        quality=read_text(keys.get("quality", "exact"), "quality"),
        passes=tuple(read_text(item, f"passes[{i}]") for i, item in enumerate(passes)),
        region=_read_region(keys.get("region")),
    )


def _read_region(content: object) -> Region | None:
    if content is None:
        return None
    if len(read_list(content, "region")) != 4:
        refuse("region", "left, top, width and height in pixels", content)
    return tuple(read_integer(value, "region") for value in content)
