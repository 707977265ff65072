"""A world without torch: a seeded moving gradient with a block for every player.

It answers in the forms of a trained environment, so Blender's side and the wire are tested with it.
"""

import hashlib
import json
import math
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import CameraError, CheckpointError, ConfigError, ShotError
from pe_runtime.contract.messages import HEADING_PREFIX
from pe_runtime.contract.model_facts import ModelFacts
from pe_runtime.contract.shot import Shot
from pe_runtime.contract.shot_track import Box, ObjectTrack
from pe_runtime.worker.fake_models import (
    ACTIONS,
    FIRST_HEADING,
    GROUND,
    MODELS,
    PLAYER,
    PLAYERS,
    STEPS_PER_SECOND,
    TURNS,
    fake_facts,
    movement,
    nearest_action,
)
from pe_runtime.worker.fake_pictures import Block, draw
from pe_runtime.worker.world import Picture, box_mesh

__all__ = ["ACTIONS", "FIRST_HEADING", "GROUND", "MODELS", "PLAYER", "TURNS", "FakeWorld"]
DETECTED = ((0.22, 0.35, 0.32, 0.85), (0.66, 0.35, 0.76, 0.85))
"""Left, top, right, bottom of the players in every picture, as shares of its size."""
SCORES = (0.9, 0.8)


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
        return fake_facts(model)

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
        for frame in frames:
            began = time.perf_counter()
            time.sleep(self._seconds_per_frame)
            buffers = draw(shot, frame, self._blocks(shot, frame, whole or shot), PLAYERS)
            yield Picture(frame, buffers, time.perf_counter() - began)

    def digests(self, shot: Shot, whole: Shot | None = None) -> dict[int, str]:
        """Over the model, the camera, what is asked for and where every player stands."""
        asked = [shot.model, shot.quality, list(shot.passes), shot.region]
        found = {}
        for frame in shot.frames:
            blocks = self._blocks(shot, frame, whole or shot)
            placed = {
                name: [*map(float, each.place), each.heading, each.held, each.green]
                for name, each in blocks.items()
            }
            content = [asked, frame, shot.camera_at(frame).as_dict(), placed]
            found[frame] = hashlib.sha256(json.dumps(content).encode()).hexdigest()
        return found

    def infer_actions(
        self, states: list[dict[str, Any]], cameras: list[Camera]
    ) -> dict[str, list[int]]:
        """The actions that move players as they moved between the states."""
        actions = MODELS[self._model].actions
        if not actions:
            raise CheckpointError(f"the model {self._model!r} has no actions to be found")
        found = {}
        for name in PLAYERS:
            places = np.array([each["objects"][name]["position"] for each in states], np.float64)
            moves = zip(cameras[:-1], np.diff(places, axis=0), strict=True)
            found[name] = [nearest_action(camera, moved, actions) for camera, moved in moves]
        return found

    def detect(self, image: np.ndarray, names: list[str]) -> dict[str, tuple[Box, float]]:
        """The players stand where they stand in every picture."""
        unknown = [name for name in names if name not in PLAYERS]
        if unknown:
            raise ConfigError(f"no object {unknown[0]!r}; expected some of {', '.join(PLAYERS)}")
        height, width = image.shape[:2]
        size = np.array([width, height, width, height])
        places = {name: (DETECTED[i], SCORES[i]) for i, name in enumerate(PLAYERS)}
        return {n: (tuple((size * places[n][0]).tolist()), places[n][1]) for n in names}

    def _blocks(self, shot: Shot, frame: int, predicted: Shot) -> dict[str, Block]:
        """The players that are seen in a frame, by the prediction and the shot's overrides."""
        known = self._latest is not None and self._latest[0] is predicted
        paths = self._latest[1] if known else self.rollout(predicted)
        index, at = frame - shot.frame_start, frame - predicted.frame_start
        blocks = {name: _block(paths, name, at) for name in PLAYERS}
        for track in shot.objects:
            block = blocks[track.name]
            place = block.place if track.locations is None else track.locations[index]
            heading = block.heading if track.headings is None else track.headings[index]
            held = _held(track, frame, predicted)
            blocks[track.name] = Block(np.array(place), heading, _green(track, frame), held)
            if track.visible is not None and not track.visible[index]:
                del blocks[track.name]
        return blocks

    def proxy_mesh(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """A box of a player's size, standing on its origin."""
        _check_track(self._model, name, [])
        return box_mesh(PLAYER.low, PLAYER.high)


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
    heading = 0.0 if headings is None else float(headings[index])
    return Block(paths[name][index], heading, _own_green(name))


def _own_green(name: str) -> float:
    return 40.0 + 150.0 * PLAYERS.index(name)


def _green(track: ObjectTrack, frame: int) -> float:
    """A player's style is its green; others lend theirs."""
    mixes = track.styles_at(frame)
    for mix in mixes:
        _check_lender(mix.image, mix.object)
    own = _own_green(track.name) * (1.0 - sum(mix.weight for mix in mixes))
    return own + sum(mix.weight * _own_green(mix.object) for mix in mixes)


def _held(track: ObjectTrack, frame: int, predicted: Shot) -> int | None:
    held = track.pose_at(frame)
    if held is not None and held not in predicted.frames:
        raise ShotError(
            f"{track.name!r} holds the pose of frame {held}; the shot has frames "
            f"{predicted.frame_start} to {predicted.frame_end}"
        )
    return held


def _check_lender(image: str | None, name: str) -> None:
    if name not in PLAYERS:
        raise ShotError(f"no object {name!r} lends a style; expected {' or '.join(PLAYERS)}")
    if image is not None and not Path(image).is_file():
        raise ShotError(f"{image} is no environment state (it does not exist)")


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
        steps.append(steps[-1] + np.append(movement(shot.camera_at(frame), action), turn))
    times = np.arange(len(shot.frames)) / frames_per_step
    columns = [np.interp(times, np.arange(len(steps)), axis) for axis in np.array(steps).T]
    return np.stack(columns, axis=1).astype(np.float64)
