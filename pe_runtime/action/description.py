"""Names for discovered actions, from how the objects moved and stood while they were taken."""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Int
from torch import Tensor

from pe_runtime.action.module import ActionModule
from pe_runtime.action.movement import ground_axes, movements
from pe_runtime.action.sequences import StateSequence

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
"""A standing action is a gesture when its mean pose is this many deviations from idle's."""


@dataclass(frozen=True)
class ActionDescription:
    """What one discovered action does.

    Attributes:
        name: Unique among the actions of its class.
        movement: Mean (right, forward) movement of one step, metres, in the movement frame.
        share: Share of all transitions that were given this action.
    """

    name: str
    movement: tuple[float, float]
    share: float


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
    of the true action that most of their steps were, where that is known; otherwise they are "idle"
    or, when the pose differs much from the pose of idle, "gesture", and "idle" is the one whose
    pose is nearest to that of moving objects. Actions never taken are "unused". Repeated names get
    "-2", "-3", in the order of the actions.
    """
    count = module.config.actions
    labels = module.infer(sequences).flatten()
    axes = ground_axes(sequences.world_from_camera, module.config.movement_frame)
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
    idle = min(standing, key=lambda k: away[k].item(), default=None)
    names = []
    for k, (right, forward) in enumerate(moves.tolist()):
        if not used[k]:
            names.append("unused")
        elif moving[k]:
            names.append(SECTORS[round(math.atan2(forward, right) / (math.pi / 4)) % 8])
        elif true and true[k]:
            names.append(true[k])
        else:
            gesture = (poses[k] - poses[idle]).norm().item() > OTHER_POSE * spread
            names.append("gesture" if gesture else "idle")
    return names


def _unique(names: list[str]) -> list[str]:
    seen: dict[str, int] = {}
    unique = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        unique.append(name if seen[name] == 1 else f"{name}-{seen[name]}")
    return unique
