"""What a model's actions are called, which way they lead, and which of them is rest."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import torch

from pe_runtime.action.description import SECTORS, STILL
from pe_runtime.action.movement import ground_axes
from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import CheckpointError
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.shots.rollout import World
from pe_runtime.state import EnvironmentState

ARROWS = dict(zip(SECTORS, "→↗↑↖←↙↓↘", strict=True))
"""Directions as signs, with forward pointing up."""
RESTS = ("idle", "stay")
"""Names of actions that are rest, as recorders and descriptions give them."""
PROBED_STEPS = 3
"""Steps for which actions without a telling name are tried out to find the quietest."""


@dataclass(frozen=True)
class LearntAction:
    """One action as the keys show it.

    Attributes:
        name: What it is called.
        movement: Mean (right, forward) metres of one step; zeros for standing, or where the model's
            file does not say.
        frame: Whose right and forward: "camera", "object" or "world".
    """

    name: str
    movement: tuple[float, float] = (0.0, 0.0)
    frame: str = "camera"

    def arrow(self, camera: Camera, heading: float) -> str:
        """Where it leads in the picture, with up for away from the camera; empty for nowhere.

        Args:
            camera: Who looks.
            heading: Of the player, radians about world z.
        """
        if self.movement == (0.0, 0.0):
            return ""
        looks = torch.tensor(camera.world_from_camera[:3, :3])
        meant = ground_axes(looks, self.frame, torch.tensor(heading, dtype=looks.dtype))
        along = meant @ torch.tensor(self.movement, dtype=looks.dtype)
        right, forward = (ground_axes(looks).T @ along).tolist()
        return ARROWS[SECTORS[round(math.atan2(forward, right) / (math.pi / 4)) % 8]]


Learnt = Mapping[str, tuple[LearntAction, ...]]
"""Actions per playable object, in the order of their indices."""


def learnt_actions(environment: PlayableEnvironment) -> dict[str, tuple[LearntAction, ...]]:
    """All actions of a model.

    Raises:
        CheckpointError: The model has no playable objects, or none of its actions are trained.
    """
    if not environment.playable_names:
        raise CheckpointError(
            f"the model {environment.config.name!r} has no playable objects, so nothing of it can "
            "be played; draw its states with `pe render`"
        )
    classes = {each.name: each.class_name for each in environment.config.objects}
    for name in environment.playable_names:
        if classes[name] not in environment.actions:
            raise CheckpointError(
                f"the model {environment.config.name!r} has no actions for {name!r} yet; train "
                "them with `pe train actions --checkpoint MODEL --config C.toml --data DATA`, or "
                "play another model"
            )
    return {n: _of_class(environment, classes[n], n) for n in environment.playable_names}


def _of_class(
    environment: PlayableEnvironment, class_name: str, name: str
) -> tuple[LearntAction, ...]:
    count = environment.config.action.actions
    names = environment.action_names[name] or tuple(f"action_{k + 1}" for k in range(count))
    facts = environment.header.get("actions", {}).get(class_name, [])
    moves = [tuple(each.get("movement", (0.0, 0.0))) for each in facts]
    if len(moves) != len(names):
        moves = [(0.0, 0.0)] * len(names)
    fastest = max(math.hypot(*move) for move in moves)
    frame = environment.config.action.movement_frame
    return tuple(
        LearntAction(each, move if math.hypot(*move) > STILL * fastest else (0.0, 0.0), frame)
        for each, move in zip(names, moves, strict=True)
    )


def resting_action(
    world: World, state: EnvironmentState, camera: Camera, name: str, actions: tuple[str, ...]
) -> int:
    """The action of an object that nobody plays: rest by name, else the one that moves it least.

    Args:
        world: The loaded environment.
        state: Where actions without a telling name are tried out.
        camera: The camera they are relative to.
        name: The object.
        actions: Names of its actions.
    """
    for word in RESTS:
        if word in actions:
            return actions.index(word)
    away = [_distance(world, state, camera, {name: action}) for action in range(len(actions))]
    return away.index(min(away))


def _distance(
    world: World, start: EnvironmentState, camera: Camera, acting: dict[str, int]
) -> float:
    """Metres that an object is away after holding an action for a few steps."""
    state, memory = start, None
    for _ in range(PROBED_STEPS):
        state, memory = world.step(state, acting, camera, memory)
    (name,) = acting
    return float(torch.linalg.vector_norm(state[name].position - start[name].position))
