"""From the start of a shot to one predicted state per frame."""

import dataclasses
import difflib
import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, Protocol, runtime_checkable

from torch import nn

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import PlayableEnvironmentError, ShotError
from pe_runtime.contract.shot import ObjectTrack, Shot, Start
from pe_runtime.environment import Frame, RenderOptions
from pe_runtime.images import read_image
from pe_runtime.state import EnvironmentState, blend, repose, state_from_dict

STEP_TOLERANCE = 1e-6
"""Steps; a frame this close to a step is at it, whatever the rounding of fps."""


@runtime_checkable
class World(Protocol):
    """What a shot runs in: a trained environment, or one that tests make up."""

    config: Any
    networks: nn.Module
    playable_names: tuple[str, ...]
    action_names: Mapping[str, tuple[str, ...]]
    steps_per_second: float

    def encode(self, image: Any, camera: Camera, boxes: Any) -> EnvironmentState: ...  # noqa: ANN401, D102

    def step(self, state: Any, actions: Any, camera: Camera, memory: Any) -> tuple: ...  # noqa: ANN401, D102

    def render(self, state: Any, camera: Camera, options: RenderOptions) -> Frame: ...  # noqa: ANN401, D102


@dataclass(frozen=True)
class Rollout:
    """The predicted states of a shot, before its overrides."""

    frame_start: int
    states: tuple[EnvironmentState, ...]
    """One per frame."""

    @property
    def frames(self) -> range:
        """All frames that are predicted."""
        return range(self.frame_start, self.frame_start + len(self.states))

    def at(self, frame: int) -> EnvironmentState:
        """Predicted state of a frame."""
        return self.states[frame - self.frame_start]


@dataclass(frozen=True)
class PreparedShot:
    """A shot with all that its frames share: any of them can be drawn, in any order."""

    shot: Shot
    rollout: Rollout
    """What is predicted, one state per frame: of a take, for the whole that it is a part of."""
    lenders: Mapping[str | None, EnvironmentState]
    """States that lend styles, by file; None is the shot's own start."""


def prepare_shot(world: World, shot: Shot, predicted: Rollout | None = None) -> PreparedShot:
    """Read everything a shot needs and roll it out.

    Args:
        world: The loaded environment.
        shot: The job.
        predicted: Its rollout, if known from before.

    Raises:
        ShotError: The shot asks for objects, actions or files that do not exist.
    """
    if predicted is None:
        predicted = rollout(world, start_state(world, shot.start), shot)
    files = {mix.image for track in shot.objects for mix in track.styles}
    lent = {path: read_state(path) for path in files if path is not None}
    return prepared_from(shot, predicted, lent)


def prepared_from(
    shot: Shot, predicted: Rollout, lent: Mapping[str, EnvironmentState]
) -> PreparedShot:
    """A shot over a prediction: its own, or that of a whole that it is a take of.

    Args:
        shot: The job.
        predicted: States of all its frames, and of others if it is a take.
        lent: The states that lend styles, by file.

    Raises:
        ShotError: The shot asks for objects, styles or poses that do not exist.
    """
    start = predicted.states[0]
    _check_named(shot, start)
    lenders = {None: start, **lent}
    _check_styles(shot, start, lenders)
    _check_poses(shot, predicted)
    return PreparedShot(shot, predicted, lenders)


def rollout_key(shot: Shot) -> str:
    """A digest of all that decides a rollout: two shots with the same key share theirs.

    The files of the start count by content, overrides, passes, region and quality not at all.
    """
    tracks = tuple(ObjectTrack(track.name, track.actions) for track in shot.objects)
    reduced = dataclasses.replace(shot, objects=tracks, quality="exact", passes=(), region=None)
    digest = hashlib.sha256(reduced.digest().encode())
    path = Path(shot.start.state or shot.start.image)
    if path.is_file():
        digest.update(path.read_bytes())
    return digest.hexdigest()


def start_state(world: World, start: Start) -> EnvironmentState:
    """The state a shot starts from: read from its file, or encoded from its picture.

    Raises:
        ShotError: The file is no state, or the picture does not have the size of its camera.
    """
    if start.state is not None:
        return read_state(start.state)
    image = read_image(start.image)
    height, width = image.shape[:2]
    if (width, height) != (start.camera.width, start.camera.height):
        raise ShotError(
            f"{start.image} is {width}x{height} pixels but its camera says "
            f"{start.camera.width}x{start.camera.height}; give the camera that saw this picture"
        )
    return world.encode(image, start.camera, start.boxes)


def read_state(path: str | Path) -> EnvironmentState:
    """Read a state file, as `pe encode` writes it.

    Raises:
        ShotError: The file is missing or holds no state.
    """
    try:
        content = json.loads(Path(path).read_text())
        if not isinstance(content, dict):
            raise ValueError(f"found a JSON {type(content).__name__}")
        return state_from_dict(content)
    except (OSError, ValueError, PlayableEnvironmentError) as error:
        raise ShotError(
            f"{path} is no environment state ({error}); write one with `pe encode`"
        ) from error


def rollout(world: World, start: EnvironmentState, shot: Shot) -> Rollout:
    """Predict the state of every frame from the actions of the shot.

    The model steps at its own rate. The action and the camera of a step are those of the last
    frame at or before the step's time. Objects without action keys stay as they are. Frames
    between two steps have positions in linear and pose codes in smooth proportion.

    Raises:
        ShotError: The shot names an object or an action that the model does not have.
    """
    _check_objects(world, shot, start)
    _check_actions(world, shot)
    frames_per_step = shot.fps / world.steps_per_second
    times = [_steps_at(index / frames_per_step) for index in range(len(shot.frames))]
    acting = [track for track in shot.objects if track.actions]
    steps, memory = [start], None
    for step in range(math.ceil(times[-1]) if acting else 0):
        index = math.floor(step * frames_per_step + STEP_TOLERANCE)
        frame = min(shot.frame_start + index, shot.frame_end)
        actions = {track.name: track.action_at(frame) for track in acting}
        state, memory = world.step(steps[-1], actions, shot.camera_at(frame), memory)
        steps.append(state)
    return Rollout(shot.frame_start, tuple(_state_at(steps, time) for time in times))


def _steps_at(time: float) -> float:
    """Time in steps, exactly whole where rounding alone kept it from being so."""
    return float(round(time)) if abs(time - round(time)) < STEP_TOLERANCE else time


def _state_at(steps: list[EnvironmentState], time: float) -> EnvironmentState:
    before = min(math.floor(time), len(steps) - 1)
    after = min(before + 1, len(steps) - 1)
    weight = time - math.floor(time)
    if weight == 0.0 or before == after:
        return steps[before]
    state = blend(steps[before], steps[after], weight)
    smooth = blend(steps[before], steps[after], weight * weight * (3.0 - 2.0 * weight))
    for name in state.objects:
        state = repose(state, name, smooth[name].pose)
    return state


def _check_actions(world: World, shot: Shot) -> None:
    for track in shot.objects:
        if track.actions and track.name not in world.playable_names:
            _refuse_name("actions", track.name, world.playable_names)
        names = world.action_names.get(track.name, ())
        for frame, action in track.actions:
            if names and action >= len(names):
                raise ShotError(
                    f"{track.name!r} has action {action} keyed at frame {frame}; the model has "
                    f"actions 0 to {len(names) - 1} ({', '.join(names)})"
                )


def _check_objects(world: World, shot: Shot, start: EnvironmentState) -> None:
    for name in world.playable_names:
        if name not in start.objects:
            raise ShotError(
                f"the start has no object {name!r} of this model (found "
                f"{', '.join(start.objects)}); encode the picture with this model"
            )
    _check_named(shot, start)
    for name in shot.layer_names:
        if name not in world.playable_names:
            _refuse_name("layers", name, world.playable_names)


def _check_named(shot: Shot, start: EnvironmentState) -> None:
    for what, names in (
        ("objects", [track.name for track in shot.objects]),
        ("passes", (*shot.mask_names, *shot.layer_names)),
    ):
        for name in names:
            if name not in start.objects:
                _refuse_name(what, name, start.objects)


def _check_poses(shot: Shot, predicted: Rollout) -> None:
    for track in shot.objects:
        for key in track.poses:
            if key.held is not None and key.held not in predicted.frames:
                raise ShotError(
                    f"{track.name!r} holds the pose of frame {key.held} from frame {key.frame} "
                    f"on; the shot has frames {predicted.frames[0]} to {predicted.frames[-1]}"
                )


def _check_styles(
    shot: Shot, start: EnvironmentState, lenders: Mapping[str | None, EnvironmentState]
) -> None:
    for track in shot.objects:
        for mix in track.styles:
            lender = lenders[mix.image]
            if mix.object not in lender.objects:
                _refuse_name(f"styles of {track.name!r}", mix.object, lender.objects)
            own, lent = start[track.name].style, lender[mix.object].style
            if own.shape != lent.shape:
                raise ShotError(
                    f"{track.name!r} cannot take the style of {mix.object!r}: {own.numel()} and "
                    f"{lent.numel()} numbers; take it from an object of the same class"
                )


def _refuse_name(where: str, name: str, known: Iterable[str]) -> NoReturn:
    near = difflib.get_close_matches(name, list(known), n=1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    raise ShotError(
        f"{where}: no object {name!r}; expected one of {', '.join(known) or 'none'}{hint}"
    )
