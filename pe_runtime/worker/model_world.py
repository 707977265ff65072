"""A trained environment behind the wire."""

import time
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ConfigError
from pe_runtime.contract.messages import HEADING_PREFIX
from pe_runtime.contract.model_facts import ModelFacts
from pe_runtime.contract.shot import Shot
from pe_runtime.contract.shot_track import Box
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.images import to_uint8
from pe_runtime.shots import (
    PreparedShot,
    Rollout,
    prepare_shot,
    render_frames,
    rollout,
    rollout_key,
    start_state,
)
from pe_runtime.state import state_as_dict
from pe_runtime.worker.loaded_facts import facts_of, turning_names
from pe_runtime.worker.world import Picture, box_mesh

REMEMBERED_ROLLOUTS = 8


@dataclass(frozen=True)
class _Latest:
    """The shot that was asked for last, ready to be drawn.

    Attributes:
        prepared: It and its prediction.
        files: What it was read from, see `_files_of`.
    """

    prepared: PreparedShot
    files: tuple


class ModelWorld:
    """Serves a PlayableEnvironment and remembers the latest rollouts.

    Blender asks for the frames of one shot in many requests, each a take of it.

    Args:
        device: Where it computes: "auto", "cpu", "cuda".
    """

    def __init__(self, device: str = "auto") -> None:
        self._device = device
        self._environment: PlayableEnvironment | None = None
        self._rollouts: OrderedDict[str, Rollout] = OrderedDict()
        self._latest: _Latest | None = None

    def load(self, model: str) -> ModelFacts:
        """Load a model by built-in name or path."""
        self._environment = PlayableEnvironment.load(model, self._device)
        self._latest = None
        return facts_of(self._environment)

    def encode(self, image: np.ndarray, camera: Camera, boxes: Mapping[str, Box]) -> dict[str, Any]:
        """State of a picture, uint8 (height, width, 3), as JSON values."""
        picture = image.astype(np.float32) / np.float32(255)
        return state_as_dict(self._environment.encode(picture, camera, boxes))

    def rollout(self, shot: Shot) -> dict[str, np.ndarray]:
        """Predicted positions and headings of the playable objects, before overrides."""
        states = self._prepared(shot).rollout.states
        positions = {
            name: np.stack([state[name].position.double().cpu().numpy() for state in states])
            for name in self._environment.playable_names
        }
        headings = {
            f"{HEADING_PREFIX}{name}": np.array([state[name].heading for state in states])
            for name in turning_names(self._environment)
        }
        return positions | headings

    def render(self, shot: Shot, frames: list[int], whole: Shot | None = None) -> Iterator[Picture]:
        """Draw frames one by one."""
        prepared = self._prepared(shot) if whole is None else _take(shot, self._prepared(whole))
        for wanted in frames:
            began = time.perf_counter()
            ((number, frame),) = render_frames(self._environment, prepared, [wanted])
            seconds = time.perf_counter() - began
            buffers = {"rgb": to_uint8(frame.rgb)}
            if frame.depth is not None:
                buffers["depth"] = frame.depth.astype(np.float32, copy=False)
            masks = {f"mask:{name}": mask for name, mask in frame.masks.items()}
            yield Picture(number, buffers | masks, seconds)

    def proxy_mesh(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """The box of an object's volume, around its origin, metres."""
        config = self._environment.config.class_of(name)
        if config.kind == "sky":
            raise ConfigError(f"{name!r} is the sky; it has no volume to stand for it")
        return box_mesh(config.low, config.high)

    def _prepared(self, shot: Shot) -> PreparedShot:
        latest, files = self._latest, _files_of(shot)
        # The very object that was prepared last needs no digest of all its frames.
        if latest is not None and latest.prepared.shot is shot and latest.files == files:
            return latest.prepared
        key = rollout_key(shot)
        if key not in self._rollouts:
            start = start_state(self._environment, shot.start)
            self._rollouts[key] = rollout(self._environment, start, shot)
        self._rollouts.move_to_end(key)
        while len(self._rollouts) > REMEMBERED_ROLLOUTS:
            self._rollouts.popitem(last=False)
        prepared = prepare_shot(self._environment, shot, self._rollouts[key])
        self._latest = _Latest(prepared, files)
        return prepared


def _take(shot: Shot, whole: PreparedShot) -> PreparedShot:
    """A part of a prepared shot, filmed in its own way; the prediction is that of the whole."""
    states = tuple(whole.rollout.at(frame) for frame in shot.frames)
    return PreparedShot(shot, Rollout(shot.frame_start, states), whole.lenders)


def _files_of(shot: Shot) -> tuple:
    """What tells that a file which a shot is made from was written again: its time and size."""
    lent = {mix.image for track in shot.objects for mix in track.styles}
    paths = [
        Path(name)
        for name in (shot.start.image, shot.start.state, *sorted(filter(None, lent)))
        if name
    ]
    found = [path.stat() for path in paths if path.is_file()]
    return tuple((each.st_mtime_ns, each.st_size) for each in found)
