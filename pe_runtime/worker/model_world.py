"""A trained environment behind the wire."""

import time
from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ConfigError
from pe_runtime.contract.messages import HEADING_PREFIX
from pe_runtime.contract.model_facts import ModelFacts
from pe_runtime.contract.shot import BACKGROUND_PASS, LAYER_PASS_PREFIX, MASK_PASS_PREFIX, Shot
from pe_runtime.contract.shot_track import Box
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.evaluation.rules import OWN_DETECTOR
from pe_runtime.images import to_uint8
from pe_runtime.shots import (
    PreparedShot,
    Rollout,
    prepare_shot,
    prepared_from,
    read_state,
    render_frames,
    rollout,
    rollout_key,
    start_state,
)
from pe_runtime.shots.frames import frame_digest, model_digest
from pe_runtime.state import EnvironmentState, state_as_dict, state_from_dict
from pe_runtime.worker.loaded_facts import facts_of, turning_names
from pe_runtime.worker.world import Picture, box_mesh

REMEMBERED_ROLLOUTS = 8
REMEMBERED_LENDERS = 32


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
        self._lent: OrderedDict[tuple, EnvironmentState] = OrderedDict()
        self._model_digest = ""

    def load(self, model: str) -> ModelFacts:
        """Load a model by built-in name or path."""
        self._environment = PlayableEnvironment.load(model, self._device)
        self._model_digest = model_digest(self._environment)
        self._latest = None
        return facts_of(self._environment, self._model_digest)

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
        prepared = self._taken(shot, whole)
        for wanted in frames:
            began = time.perf_counter()
            ((number, frame),) = render_frames(self._environment, prepared, [wanted])
            seconds = time.perf_counter() - began
            buffers = {"rgb": to_uint8(frame.rgb)}
            if frame.depth is not None:
                buffers["depth"] = frame.depth.astype(np.float32, copy=False)
            if frame.background is not None:
                buffers[BACKGROUND_PASS] = to_uint8(frame.background)
            buffers |= {f"{MASK_PASS_PREFIX}{name}": mask for name, mask in frame.masks.items()}
            for name, layer in frame.layers.items():
                buffers[f"{LAYER_PASS_PREFIX}{name}"] = to_uint8(layer)
            yield Picture(number, buffers, seconds)

    def digests(self, shot: Shot, whole: Shot | None = None) -> dict[int, str]:
        """Per frame a digest over everything that decides its pixels."""
        prepared, model = self._taken(shot, whole), self._model_digest
        return {frame: frame_digest(model, prepared, frame) for frame in shot.frames}

    def infer_actions(
        self, states: list[dict[str, Any]], cameras: list[Camera]
    ) -> dict[str, list[int]]:
        """The actions that lead from every state to the next."""
        found = self._environment.infer_actions(list(map(state_from_dict, states)), cameras)
        return {name: actions.tolist() for name, actions in found.items()}

    def detect(self, image: np.ndarray, names: list[str]) -> dict[str, tuple[Box, float]]:
        """The surest people of a picture, by name from left to right."""
        for name in names:
            if name not in self._environment.playable_names:
                known = ", ".join(self._environment.playable_names) or "none"
                raise ConfigError(f"no playable object {name!r}; this model has {known}")
        if not OWN_DETECTOR.is_file():
            raise ConfigError(
                f"this runtime has no person detector ({OWN_DETECTOR.name} is missing); draw the "
                "boxes by hand, or install the runtime anew"
            )
        # Late: few ask for it, and a worker's start need not wait for OpenCV.
        from pe_runtime.evaluation.detector_network import load_detector
        from pe_runtime.evaluation.finding_people import find_players

        picture = image.astype(np.float32) / np.float32(255)
        return find_players(load_detector(OWN_DETECTOR).logits(picture), names)

    def proxy_mesh(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """The box of an object's volume, around its origin, metres."""
        config = self._environment.config.class_of(name)
        if config.kind == "sky":
            raise ConfigError(f"{name!r} is the sky; it has no volume to stand for it")
        return box_mesh(config.low, config.high)

    def _taken(self, shot: Shot, whole: Shot | None) -> PreparedShot:
        """A shot ready to be drawn; a take of a whole over the prediction of that."""
        if whole is None:
            return self._prepared(shot)
        files = {mix.image for track in shot.objects for mix in track.styles}
        lent = {name: self._read_lender(name) for name in files if name is not None}
        return prepared_from(shot, self._prepared(whole).rollout, lent)

    def _read_lender(self, name: str) -> EnvironmentState:
        """A state file, read again only if it was written again: takes come frame by frame."""
        key = name, _stamps([name])
        if key not in self._lent:
            self._lent[key] = read_state(name)
        self._lent.move_to_end(key)
        while len(self._lent) > REMEMBERED_LENDERS:
            self._lent.popitem(last=False)
        return self._lent[key]

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


def _files_of(shot: Shot) -> tuple:
    """What tells that a file which a shot is made from was written again: its time and size."""
    lent = {mix.image for track in shot.objects for mix in track.styles}
    names = (shot.start.image, shot.start.state, *sorted(filter(None, lent)))
    return _stamps([name for name in names if name])


def _stamps(names: Sequence[str]) -> tuple:
    """Time and size of the files that exist."""
    found = [path.stat() for path in map(Path, names) if path.is_file()]
    return tuple((each.st_mtime_ns, each.st_size) for each in found)
