"""Names for discovered actions, from how the objects moved and stood while they were taken."""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Int
from torch import Tensor

from pe_runtime.action.module import ActionModule
from pe_runtime.action.movement import movements
from pe_runtime.action.sequences import PlayerState, StateSequence

SECTORS = (
    "right",
    "forward-right",
    "forward",
    "forward-left",
    "left",
    "back-left",
    "back",
    "back-right",
)
"""Directions anticlockwise from the right, seen from above with forward pointing up."""

STILL = 0.35
"""Actions slower than this share of the fastest one count as standing."""

OTHER_POSE = 0.5
"""A standing action is a gesture when its mean pose is this many deviations from stay's."""


@dataclass(frozen=True)
class ActionDescription:
    """What one discovered action does.

    Attributes:
        name: Unique among the actions of its class.
        movement: Mean (right, forward) movement of one step, metres, in the movement frame.
        share: Share of all transitions that were given this action; None where it was named
            without any.
    """

    name: str
    movement: tuple[float, float]
    share: float | None


@dataclass(frozen=True)
class KnownActions:
    """What was really done, where a recorder knows it; helps only to name what was discovered.

    Attributes:
        labels: True action of each transition; -1 where unknown.
        names: Name of each true action.
    """

    labels: Int[Tensor, "batch moves"]
    names: tuple[str, ...]


@torch.no_grad()
def describe_actions(
    module: ActionModule, sequences: StateSequence, known: KnownActions | None = None
) -> tuple[ActionDescription, ...]:
    """Say in words what each action does, as seen on (encoded) sequences.

    Moving actions are named by direction ("left", "forward-left", ...). Standing ones take the name
    of the true action that most of their steps were, where that is known; otherwise they are "stay"
    or, when the pose differs much from the pose of stay, "gesture", and "stay" is the one whose
    pose is nearest to that of moving objects. Actions never taken are "unused". Repeated names get
    "-2", "-3", in the order of the actions.
    """
    count = module.config.actions
    labels = module.infer(sequences).flatten()
    axes = sequences.axes(module.config.movement_frame)
    moves = movements(sequences.positions, axes).flatten(0, 1)
    taken = torch.nn.functional.one_hot(labels, count).to(moves)
    totals = taken.sum(dim=0)
    weights = taken / totals.clamp_min(1.0)
    mean_moves = weights.T @ moves
    mean_poses = weights.T @ sequences.poses[:, 1:].flatten(0, 1)
    spread = sequences.poses.flatten(0, 1).std(dim=0, unbiased=False).norm().item()
    true = None if known is None else _majority(weights, known)
    names = _unique(_names(mean_moves, mean_poses, spread, totals > 0, true))
    share = totals / max(labels.numel(), 1)
    return tuple(
        ActionDescription(name, (move[0].item(), move[1].item()), part.item())
        for name, move, part in zip(names, mean_moves, share, strict=True)
    )


def neutral_starts(
    module: ActionModule, around: tuple[float, float, float] = (0.0, 0.0, 0.0), reach: float = 0.1
) -> PlayerState:
    """Five objects with average codes that look along world y, at a place and on its four sides.

    Args:
        module: The action module that is to move them.
        around: The place, metres.
        reach: How far away the sides are, in `position_scale`.
    """
    dynamics = module.dynamics
    sides = torch.tensor([[0, 0, 0], [1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
    place = torch.tensor(around, device=dynamics.position_scale.device)
    position = place + reach * sides.to(place) * dynamics.position_scale
    style = 0 if dynamics.style is None else dynamics.style.out_features
    codes = [position.new_zeros(len(position), n) for n in (style, dynamics.pose.out_features)]
    return PlayerState(position, *codes, position.new_zeros(len(position)))


@torch.no_grad()
def describe_by_rollout(
    module: ActionModule, starts: PlayerState | None = None, steps: int = 8
) -> tuple[ActionDescription, ...]:
    """Say in words what each action does where no sequences are at hand, by doing it.

    Every action is held for some steps from every start, without variability. Those that move are
    named by the mean direction in the movement frame, all others are "stay"; repeated names get
    "-2", "-3", in the order of the actions.

    Args:
        module: The action module, in evaluation mode.
        starts: Where from; `neutral_starts` when None.
        steps: Model steps per rollout.
    """
    starts = neutral_starts(module) if starts is None else starts
    count = len(starts.position)
    # A level camera that looks along world y. Movements are measured before it turns them.
    looks_along_y = torch.tensor([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]).to(starts.position)
    camera = looks_along_y.expand(count, 3, 3)
    mean_moves = []
    for action in range(module.config.actions):
        held = torch.full((count,), action, device=starts.position.device)
        moves, state, memory = [], starts, None
        for _ in range(steps):
            step = module.step(state, held, camera, memory)
            moves.append(step.movement)
            state, memory = step.state, step.memory
        mean_moves.append(torch.stack(moves).mean(dim=(0, 1)))
    speeds = torch.stack(mean_moves).norm(dim=1)
    moving = (speeds > STILL * speeds.max()).tolist()
    pairs = [(right, forward) for right, forward in torch.stack(mean_moves).tolist()]
    names = [_sector(*pair) if goes else "stay" for pair, goes in zip(pairs, moving, strict=True)]
    return tuple(
        ActionDescription(name, pair, None)
        for name, pair in zip(_unique(names), pairs, strict=True)
    )


def _majority(weights: Tensor, known: KnownActions) -> list[str | None]:
    """Name of the true action of more than half of each action's steps, if there is one."""
    flat = known.labels.flatten()
    shares = torch.stack([weights.T @ (flat == k).to(weights) for k in range(len(known.names))])
    most, which = shares.max(dim=0)
    pairs = zip(most.tolist(), which.tolist(), strict=True)
    return [known.names[index] if share > 0.5 else None for share, index in pairs]


def _names(
    moves: Tensor, poses: Tensor, spread: float, used: Tensor, true: list[str | None] | None
) -> list[str]:
    speed = moves.norm(dim=1)
    moving = used & (speed > STILL * speed.max())
    standing = [k for k in range(len(moves)) if used[k] and not moving[k]]
    away = (poses - poses[moving].mean(dim=0)).norm(dim=1) if moving.any() else poses.norm(dim=1)
    stay = min(standing, key=lambda k: away[k].item(), default=None)
    names = []
    for k, (right, forward) in enumerate(moves.tolist()):
        if not used[k]:
            names.append("unused")
        elif moving[k]:
            names.append(_sector(right, forward))
        elif true and true[k]:
            names.append(true[k])
        else:
            gesture = (poses[k] - poses[stay]).norm().item() > OTHER_POSE * spread
            names.append("gesture" if gesture else "stay")
    return names


def _sector(right: float, forward: float) -> str:
    """Name of a direction."""
    return SECTORS[round(math.atan2(forward, right) / (math.pi / 4)) % 8]


def _unique(names: list[str]) -> list[str]:
    seen: dict[str, int] = {}
    unique = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        unique.append(name if seen[name] == 1 else f"{name}-{seen[name]}")
    return unique
