"""The fake models: what they know, how their players move, and how that is told from movements."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.envelope import Envelope
from pe_runtime.contract.model_facts import ModelFacts, Volume
from pe_runtime.worker.fake_pictures import PLAYER_SIZE

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
ENVELOPE = Envelope(
    positions=((-6.0, -5.0), (6.0, 5.0)),
    camera_heights=(1.0, 6.0),
    camera_distances=(3.0, 16.0),
    camera_pitches=(-40.0, 0.0),
    fields_of_view=(25.0, 75.0),
    box_heights=(0.05, 0.8),
)


@dataclass(frozen=True)
class FakeModel:
    """What tells the fake models apart.

    Attributes:
        actions: Names of the actions of either player.
        turns: Whether players have a heading.
        licence: Terms of its weights, had it any.
        envelope: What it was trained on, had it been.
    """

    actions: tuple[str, ...] = ACTIONS
    turns: bool = False
    licence: str = ""
    envelope: Envelope | None = ENVELOPE


MODELS = {
    "duel": FakeModel(),
    "fake": FakeModel(),
    "turning": FakeModel((*ACTIONS[1:], ACTIONS[0]), turns=True, licence="Only to be tested"),
    "still": FakeModel((), envelope=None),
}


def fake_facts(name: str) -> ModelFacts:
    """Facts of one of MODELS."""
    model = MODELS[name]
    actions, turns = model.actions, model.turns
    moves = tuple(tuple(STEP_LENGTH * share for share in _move(action)) for action in actions)
    return ModelFacts(
        name=name,
        action_names=dict.fromkeys(PLAYERS, actions),
        steps_per_second=STEPS_PER_SECOND,
        width=256,
        height=144,
        resting_actions=dict.fromkeys(PLAYERS, actions.index("idle")) if actions else {},
        turning_names=PLAYERS if turns else (),
        volumes={"ground": GROUND} | dict.fromkeys(PLAYERS, PLAYER),
        usual_camera=usual_camera(),
        licence=model.licence,
        movements=dict.fromkeys(PLAYERS, moves),
        envelope=model.envelope,
        detects=True,
        device="cpu",
        digest=hashlib.sha256(name.encode()).hexdigest(),
    )


def usual_camera() -> Camera:
    """At 8 m before the origin, 2.5 m up, looking along +y and a little down."""
    pose = np.eye(4)
    pose[:3, :3] = np.array([[1.0, 0.0, 0.0], [0.0, -0.28, 0.96], [0.0, -0.96, -0.28]])
    pose[:3, 3] = 0.0, -8.0, 2.5
    intrinsics = np.array([[256.0, 0.0, 128.0], [0.0, 256.0, 72.0], [0.0, 0.0, 1.0]])
    return Camera(256, 144, intrinsics, pose)


def movement(camera: Camera, action: str) -> np.ndarray:
    """Metres (3,) that an action moves a player in one step."""
    return np.append(_ground_axes(camera) @ np.array(_move(action)) * STEP_LENGTH, 0.0)


def nearest_action(camera: Camera, moved: np.ndarray, actions: Sequence[str]) -> int:
    """Index of the action whose movement is nearest to one of (3,) metres; rest before others."""
    distances = [float(np.linalg.norm(movement(camera, each) - moved)) for each in actions]
    least = min(distances) + 1e-6
    fitting = [index for index, distance in enumerate(distances) if distance <= least]
    return next((index for index in fitting if actions[index] == "idle"), fitting[0])


def _move(action: str) -> tuple[float, float]:
    return MOVES.get(action, (0.0, 0.0))


def _ground_axes(camera: Camera) -> np.ndarray:
    """The camera's right and its view along the ground, as the columns of a (2, 2) matrix."""
    axes = camera.world_from_camera[:2, [0, 2]]
    return axes / np.maximum(np.linalg.norm(axes, axis=0), 1e-9)
