"""A world without torch: a seeded moving gradient with a block for every player.

It answers in the forms of a trained environment, so Blender's side and the wire are tested with it.
"""

import json
import math
import time
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pe_runtime.contract.camera import Camera, project
from pe_runtime.contract.errors import CameraError, CheckpointError, ShotError
from pe_runtime.contract.messages import ModelFacts
from pe_runtime.contract.shot import Shot
from pe_runtime.contract.shot_track import Box
from pe_runtime.worker.serving import Picture, box_mesh

MODELS = ("duel", "fake")
PLAYERS = ("player_1", "player_2")
ACTIONS = ("idle", "left", "right", "forward", "back", "raise_arm")
STEPS_PER_SECOND = 5.0
STEP_LENGTH = 0.3
"""Metres that a movement covers in one step."""
MOVES = {"left": (-1.0, 0.0), "right": (1.0, 0.0), "forward": (0.0, 1.0), "back": (0.0, -1.0)}
"""Per action: share along the camera's right and along its view, both on the ground."""
PLAYER_SIZE = (0.5, 1.8)
"""Width and height of a block, metres."""


class FakeWorld:
    """Moves players by their actions and draws them on a gradient, always the same for a shot.

    Args:
        seconds_per_frame: Time that drawing pretends to take.
    """

    def __init__(self, seconds_per_frame: float = 0.0) -> None:
        self._seconds_per_frame = seconds_per_frame

    def load(self, model: str) -> ModelFacts:
        """Facts of the fake model.

        Raises:
            CheckpointError: Another model was asked for.
        """
        if model not in MODELS:
            raise CheckpointError(f"no model {model!r}; the fake worker knows {', '.join(MODELS)}")
        return ModelFacts(model, dict.fromkeys(PLAYERS, ACTIONS), STEPS_PER_SECOND, 256, 144)

    def encode(self, image: np.ndarray, camera: Camera, boxes: Mapping[str, Box]) -> dict[str, Any]:
        """Players stand where the lower edges of their boxes meet the ground."""
        if image.shape[:2] != (camera.height, camera.width):
            raise ShotError(
                f"the picture is {image.shape[1]}x{image.shape[0]} pixels but its camera says "
                f"{camera.width}x{camera.height}"
            )
        return {"format": 1, "objects": {name: _encode(name, camera, boxes) for name in PLAYERS}}

    def rollout(self, shot: Shot) -> dict[str, np.ndarray]:
        """Positions per frame, (frames, 3) float64: straight moves relative to the camera."""
        for track in shot.objects:
            _check_track(track.name, [action for _, action in track.actions])
        start = _start_positions(shot)
        return {name: _walk(shot, name, start[name]) for name in PLAYERS}

    def render(self, shot: Shot, frames: list[int]) -> Iterator[Picture]:
        """Pictures that depend on nothing but the shot and the frame."""
        paths = self.rollout(shot)
        for frame in frames:
            time.sleep(self._seconds_per_frame)
            index = frame - shot.frame_start
            places = {name: path[index] for name, path in paths.items()}
            for track in shot.objects:
                if track.locations is not None:
                    places[track.name] = np.array(track.locations[index])
                if track.visible is not None and not track.visible[index]:
                    del places[track.name]
            yield Picture(frame, _draw(shot, frame, places))

    def proxy_mesh(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """A box of a player's size, standing on its origin."""
        _check_track(name, [])
        half, height = PLAYER_SIZE[0] / 2, PLAYER_SIZE[1]
        return box_mesh((-half, -half, 0.0), (half, half, height))


def _encode(name: str, camera: Camera, boxes: Mapping[str, Box]) -> dict[str, Any]:
    seen = name in boxes
    place = _foot(camera, name, boxes[name]) if seen else [0.0, 0.0, 0.0]
    return {"position": place, "style": [0.5], "pose": [0.0], "visible": seen}


def _foot(camera: Camera, name: str, box: Box) -> list[float]:
    """Where the middle of a box's lower edge meets the ground, environment space."""
    left, top, right, bottom = box
    if not (right > left and bottom > top):
        raise ShotError(f"the box of {name!r} has no area: {[left, top, right, bottom]}")
    pixel = np.array([(left + right) / 2, bottom, 1.0])
    direction = camera.world_from_camera[:3, :3] @ np.linalg.solve(camera.intrinsics, pixel)
    origin = camera.world_from_camera[:3, 3]
    if direction[2] >= -1e-6 or origin[2] <= 0:
        raise CameraError(
            f"the foot of {name!r} is at or above the horizon; draw its box down to the ground"
        )
    return (origin - direction * (origin[2] / direction[2])).tolist()


def _start_positions(shot: Shot) -> dict[str, np.ndarray]:
    path = Path(shot.start.state or shot.start.image)
    if not path.is_file():
        raise ShotError(f"the shot starts from {path}, which does not exist")
    if shot.start.state is None:
        objects = {name: _encode(name, shot.start.camera, shot.start.boxes) for name in PLAYERS}
    else:
        try:
            objects = json.loads(path.read_text())["objects"]
        except (ValueError, KeyError, TypeError) as error:
            raise ShotError(f"{path} is no environment state ({error!r})") from error
    return {name: np.array(objects[name]["position"]) for name in PLAYERS}


def _check_track(name: str, actions: list[int]) -> None:
    if name not in PLAYERS:
        raise ShotError(f"no object {name!r}; expected one of {', '.join(PLAYERS)}")
    for action in actions:
        if action >= len(ACTIONS):
            raise ShotError(f"{name!r} has action {action}; the model has {', '.join(ACTIONS)}")


def _walk(shot: Shot, name: str, start: np.ndarray) -> np.ndarray:
    frames_per_step = shot.fps / STEPS_PER_SECOND
    steps = [start]
    for step in range(math.ceil((len(shot.frames) - 1) / frames_per_step)):
        frame = min(shot.frame_start + math.floor(step * frames_per_step + 1e-6), shot.frame_end)
        action = ACTIONS[shot.action_at(name, frame) or 0]
        steps.append(steps[-1] + _movement(shot.camera_at(frame), action))
    times = np.arange(len(shot.frames)) / frames_per_step
    columns = [np.interp(times, np.arange(len(steps)), axis) for axis in np.array(steps).T]
    return np.stack(columns, axis=1).astype(np.float64)


def _movement(camera: Camera, action: str) -> np.ndarray:
    share = np.array(MOVES.get(action, (0.0, 0.0)))
    axes = camera.world_from_camera[:2, [0, 2]]
    ground = axes / np.maximum(np.linalg.norm(axes, axis=0), 1e-9)
    return np.append(ground @ share * STEP_LENGTH, 0.0)


def _draw(shot: Shot, frame: int, places: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    camera = shot.camera_at(frame)
    rows, columns = np.mgrid[: camera.height, : camera.width]
    seed = zlib.crc32(shot.model.encode()) % 97
    drift = camera.world_from_camera[:2, 3] * 16.0
    rgb = np.stack(
        [columns + drift[0] + frame, rows + drift[1] + seed, columns + rows + 2 * frame], axis=-1
    )
    buffers = {"rgb": (np.floor(rgb) % 256).astype(np.uint8)}
    depth = np.full((camera.height, camera.width), np.inf, np.float32)
    masks = {name: np.zeros_like(depth) for name in (*PLAYERS, *shot.mask_names)}
    far_first = sorted(places, key=lambda name: -project(camera, places[name][None])[1][0])
    for name in far_first:
        inside, distance = _block(camera, places[name], rows, columns)
        buffers["rgb"][inside] = (230, 40 + 150 * PLAYERS.index(name), 60)
        depth[inside] = distance
        for other in masks:
            masks[other][inside] = other == name
    if shot.wants_depth:
        buffers["depth"] = depth
    return buffers | {f"mask:{name}": masks[name] for name in shot.mask_names}


def _block(
    camera: Camera, place: np.ndarray, rows: np.ndarray, columns: np.ndarray
) -> tuple[np.ndarray, float]:
    """Pixels of an upright block at a place, and its planar depth in metres."""
    ends, depths = project(camera, np.stack([place, place + [0.0, 0.0, PLAYER_SIZE[1]]]))
    if not (depths > 0).all():
        return np.zeros(rows.shape, bool), math.inf
    half = camera.intrinsics[0, 0] * PLAYER_SIZE[0] / 2 / depths[0]
    across = np.abs(columns + 0.5 - ends[0, 0]) < half
    along = (rows + 0.5 < ends[0, 1]) & (rows + 0.5 > ends[1, 1])
    return across & along, float(depths[0])
