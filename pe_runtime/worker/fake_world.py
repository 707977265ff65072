"""A world without torch: a seeded moving gradient with a block for every player.

It answers in the forms of a trained environment, so Blender's side and the wire are tested with it.
"""

import json
import math
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import CameraError, CheckpointError, ShotError
from pe_runtime.contract.messages import HEADING_PREFIX
from pe_runtime.contract.model_facts import ModelFacts, Volume
from pe_runtime.contract.shot import Shot
from pe_runtime.contract.shot_track import Box
from pe_runtime.worker.fake_pictures import PLAYER_SIZE, Block, draw
from pe_runtime.worker.serving import Picture, box_mesh

PLAYERS = ("player_1", "player_2")
ACTIONS = ("idle", "left", "right", "forward", "back", "raise_arm")
STEPS_PER_SECOND = 5.0
STEP_LENGTH = 0.3
"""Metres that a movement covers in one step."""
MOVES = {"left": (-1.0, 0.0), "right": (1.0, 0.0), "forward": (0.0, 1.0), "back": (0.0, -1.0)}
"""Per action: share along the camera's right and along its view, both on the ground."""
TURNS = {"left": 0.4, "right": -0.4}
"""Per action: radians by which a player of a turning model turns in one step."""
FIRST_HEADING = 0.5
"""Radians that the encoder of a turning model sees in every picture."""
HALF = PLAYER_SIZE[0] / 2
PLAYER = Volume((-HALF, -HALF, 0.0), (HALF, HALF, PLAYER_SIZE[1]))
GROUND = Volume((-14.0, -12.0, -0.02), (14.0, 9.0, 0.0))


@dataclass(frozen=True)
class FakeModel:
    """What tells the fake models apart.

    Attributes:
        actions: Names of the actions of either player.
        turns: Whether players have a heading.
        licence: Terms of its weights, had it any.
    """

    actions: tuple[str, ...] = ACTIONS
    turns: bool = False
    licence: str = ""


MODELS = {
    "duel": FakeModel(),
    "fake": FakeModel(),
    "turning": FakeModel((*ACTIONS[1:], ACTIONS[0]), turns=True, licence="Only to be tested"),
    "still": FakeModel(()),
}


class FakeWorld:
    """Moves players by their actions and draws them on a gradient, always the same for a shot.

    Args:
        seconds_per_frame: Time that drawing pretends to take.
    """

    def __init__(self, seconds_per_frame: float = 0.0) -> None:
        self._seconds_per_frame = seconds_per_frame
        self._model = "fake"
        self._latest: tuple[Shot, dict[str, np.ndarray]] | None = None

    def load(self, model: str) -> ModelFacts:
        """Facts of a fake model.

        Raises:
            CheckpointError: Another model was asked for.
        """
        if model not in MODELS:
            raise CheckpointError(f"no model {model!r}; the fake worker knows {', '.join(MODELS)}")
        self._model = model
        actions, turns = MODELS[model].actions, MODELS[model].turns
        return ModelFacts(
            name=model,
            action_names=dict.fromkeys(PLAYERS, actions),
            steps_per_second=STEPS_PER_SECOND,
            width=256,
            height=144,
            resting_actions=dict.fromkeys(PLAYERS, actions.index("idle")) if actions else {},
            turning_names=PLAYERS if turns else (),
            volumes={"ground": GROUND} | dict.fromkeys(PLAYERS, PLAYER),
            usual_camera=_usual_camera(),
            licence=MODELS[model].licence,
        )

    def encode(self, image: np.ndarray, camera: Camera, boxes: Mapping[str, Box]) -> dict[str, Any]:
        """Players stand where the lower edges of their boxes meet the ground."""
        if image.shape[:2] != (camera.height, camera.width):
            raise ShotError(
                f"the picture is {image.shape[1]}x{image.shape[0]} pixels but its camera says "
                f"{camera.width}x{camera.height}"
            )
        ground = {"position": [0.0, 0.0, 0.0], "style": [0.5], "pose": [], "visible": True}
        players = {name: _encode(self._model, name, camera, boxes) for name in PLAYERS}
        return {"format": 1, "objects": {"ground": ground} | players}

    def rollout(self, shot: Shot) -> dict[str, np.ndarray]:
        """Positions (frames, 3), straight moves relative to the camera, and headings if any."""
        for track in shot.objects:
            _check_track(shot.model, track.name, [action for _, action in track.actions])
        start = _start_objects(shot)
        paths = {name: _walk(shot, name, start[name]) for name in PLAYERS}
        found = {name: path[:, :3] for name, path in paths.items()}
        if MODELS[shot.model].turns:
            found |= {f"{HEADING_PREFIX}{name}": path[:, 3] for name, path in paths.items()}
        self._latest = shot, found
        return found

    def render(self, shot: Shot, frames: list[int], whole: Shot | None = None) -> Iterator[Picture]:
        """Pictures that depend on nothing but the shot, the frame and the whole."""
        predicted = whole or shot
        known = self._latest is not None and self._latest[0] is predicted
        paths = self._latest[1] if known else self.rollout(predicted)
        for frame in frames:
            began = time.perf_counter()
            time.sleep(self._seconds_per_frame)
            index, at = frame - shot.frame_start, frame - predicted.frame_start
            blocks = {name: _block(paths, name, at) for name in PLAYERS}
            for track in shot.objects:
                block = blocks[track.name]
                place = block.place if track.locations is None else track.locations[index]
                heading = block.heading if track.headings is None else track.headings[index]
                blocks[track.name] = Block(np.array(place), heading)
                if track.visible is not None and not track.visible[index]:
                    del blocks[track.name]
            buffers = draw(shot, frame, blocks, PLAYERS)
            yield Picture(frame, buffers, time.perf_counter() - began)

    def proxy_mesh(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """A box of a player's size, standing on its origin."""
        _check_track(self._model, name, [])
        return box_mesh(PLAYER.low, PLAYER.high)


def _usual_camera() -> Camera:
    """At 8 m before the origin, 2.5 m up, looking along +y and a little down."""
    pose = np.eye(4)
    pose[:3, :3] = np.array([[1.0, 0.0, 0.0], [0.0, -0.28, 0.96], [0.0, -0.96, -0.28]])
    pose[:3, 3] = 0.0, -8.0, 2.5
    intrinsics = np.array([[256.0, 0.0, 128.0], [0.0, 256.0, 72.0], [0.0, 0.0, 1.0]])
    return Camera(256, 144, intrinsics, pose)


def _encode(model: str, name: str, camera: Camera, boxes: Mapping[str, Box]) -> dict[str, Any]:
    seen = name in boxes
    place = _foot(camera, name, boxes[name]) if seen else [0.0, 0.0, 0.0]
    found = {"position": place, "style": [0.5], "pose": [0.0], "visible": seen}
    return found | {"heading": FIRST_HEADING if MODELS[model].turns else 0.0}


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


def _start_objects(shot: Shot) -> dict[str, np.ndarray]:
    """Position and heading (4,) of every player at the start."""
    path, start = Path(shot.start.state or shot.start.image), shot.start
    if not path.is_file():
        raise ShotError(f"the shot starts from {path}, which does not exist")
    if start.state is None:
        found = {n: _encode(shot.model, n, start.camera, start.boxes) for n in PLAYERS}
    else:
        try:
            found = json.loads(path.read_text())["objects"]
        except (ValueError, KeyError, TypeError) as error:
            raise ShotError(f"{path} is no environment state ({error!r})") from error
    return {n: np.array([*found[n]["position"], found[n].get("heading", 0.0)]) for n in PLAYERS}


def _block(paths: Mapping[str, np.ndarray], name: str, index: int) -> Block:
    headings = paths.get(f"{HEADING_PREFIX}{name}")
    return Block(paths[name][index], 0.0 if headings is None else float(headings[index]))


def _check_track(model: str, name: str, actions: list[int]) -> None:
    if name not in PLAYERS:
        raise ShotError(f"no object {name!r}; expected one of {', '.join(PLAYERS)}")
    known = MODELS[model].actions
    for action in actions:
        if action >= len(known):
            raise ShotError(
                f"{name!r} has action {action}; the model has {', '.join(known) or 'no actions'}"
            )


def _walk(shot: Shot, name: str, start: np.ndarray) -> np.ndarray:
    """Position and heading per frame, (frames, 4)."""
    model, frames_per_step, steps = MODELS[shot.model], shot.fps / STEPS_PER_SECOND, [start]
    for step in range(math.ceil((len(shot.frames) - 1) / frames_per_step)):
        frame = min(shot.frame_start + math.floor(step * frames_per_step + 1e-6), shot.frame_end)
        keyed = shot.action_at(name, frame)
        action = "idle" if keyed is None else model.actions[keyed]
        turn = TURNS.get(action, 0.0) if model.turns else 0.0
        steps.append(steps[-1] + np.append(_movement(shot.camera_at(frame), action), turn))
    times = np.arange(len(shot.frames)) / frames_per_step
    columns = [np.interp(times, np.arange(len(steps)), axis) for axis in np.array(steps).T]
    return np.stack(columns, axis=1).astype(np.float64)


def _movement(camera: Camera, action: str) -> np.ndarray:
    share = np.array(MOVES.get(action, (0.0, 0.0)))
    axes = camera.world_from_camera[:2, [0, 2]]
    ground = axes / np.maximum(np.linalg.norm(axes, axis=0), 1e-9)
    return np.append(ground @ share * STEP_LENGTH, 0.0)
