"""Stress of the dynamics network R: rollouts of ten thousand steps, and their gradients."""

from collections.abc import Mapping
from functools import partial

import numpy as np
import torch
from torch import Tensor

from pe_runtime.action.module import ActionModule
from pe_runtime.action.sequences import PlayerState
from pe_runtime.benchmark.stress_cases import (
    Case,
    Measured,
    Outcome,
    Spread,
    Trial,
    compare,
    finite,
    gradients,
    worst,
)
from pe_runtime.benchmark.stress_reference import as_tensor
from pe_runtime.config import ActionConfig

DESIGNS = ("ours", "turning")
STARTS, ACTIONS, STYLE, POSE = 5, 4, 3, 4
GRADED = 400
"""Steps through which gradients are taken at most; so many more would only take longer."""
SINGLE = torch.finfo(torch.float32).eps
CARRIED = 16
"""Roundings inside a step are more than those of its results, by which a rollout is shaken."""

Weights = Mapping[str, np.ndarray]


def action_config(design: str, scale: float = 1.0) -> ActionConfig:
    """A small action module: ours, or with what the paper's authors have otherwise.

    Args:
        design: One of `DESIGNS`.
        scale: Metres that everything is large.
    """
    turning = {
        "design": "state",
        "movement_frame": "object",
        "sees_heading": True,
        "predict_heading": True,
        "predict_style": True,
        "bounded_positions": False,
        "discriminator": "states",
    }
    return ActionConfig(
        actions=ACTIONS,
        hidden=8,
        variability=2,
        dynamics_width=12,
        discriminator_width=8,
        position_scale=(4.0 * scale, 4.0 * scale, 2.0 * scale),
        discriminator_scale=(4.0 * scale, 4.0 * scale, 2.0 * scale),
        movement_scale=0.3 * scale,
        **(turning if design == "turning" else {}),
    )


def seeded_module(config: ActionConfig, seed: int) -> ActionModule:
    """An action module whose weights, also those that start at zero, are random."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return ActionModule(config, STYLE, POSE)


def roll_out(design: str, trial: Trial) -> Outcome:
    """Held, alternating and random actions from starts near and far, step after step."""
    config = action_config(design, trial["scale"])
    module = seeded_module(config, trial.seed)
    generator = trial.generator()
    away = torch.tensor([0.0, 1.0, 1.0, 10.0, 1e5])[:, None] * trial["scale"]
    start = PlayerState(
        torch.randn(STARTS, 3, generator=generator) * away,
        torch.randn(STARTS, STYLE, generator=generator),
        torch.randn(STARTS, POSE, generator=generator),
        torch.zeros(STARTS) if config.predict_heading else None,
    )
    tracks = torch.randint(ACTIONS, (STARTS, trial.count("steps")), generator=generator)
    tracks[0], tracks[1] = 1, torch.arange(tracks.shape[1]) % ACTIONS
    looks = torch.linalg.qr(torch.randn(STARTS, 3, 3, generator=generator)).Q
    with torch.inference_mode(), trial.mixed():
        last = _played(module, start, tracks, looks)
    forward = _against_truth(trial, module, (start, tracks, looks), last)
    return Outcome(forward, _graded(trial, module, (start, tracks[:, :GRADED], looks)))


def _played(module: ActionModule, state: PlayerState, tracks: Tensor, looks: Tensor) -> PlayerState:
    """The last state of a rollout."""
    memory = None
    for actions in tracks.unbind(dim=1):
        step = module.step(state, actions, looks, memory)
        state, memory = step.state, step.memory
    return state


def _against_truth(
    trial: Trial, module: ActionModule, rollout: tuple, last: PlayerState
) -> Measured:
    """Compare the end of a rollout with float64, and with how far roundings carry it there."""
    start, tracks, looks = rollout
    weights = {n: t.double().numpy() for n, t in module.dynamics.state_dict().items()}
    given = (tracks.numpy(), looks.double().numpy())
    shaken = slow_rollout(weights, module.config, start, given, trial.epsilon)
    reach = shaken["path"][:STARTS] + np.abs(shaken["position"][:STARTS]).max(axis=1)
    base = 8 * trial.epsilon + tracks.shape[1] * SINGLE
    measured = []
    for found, name, unit in ((last.position, "position", reach), (last.pose, "pose", 1.0)):
        truth, other = shaken[name][:STARTS], shaken[name][STARTS:]
        unit = np.broadcast_to(unit, STARTS)
        bounds = base + CARRIED * np.abs(other - truth).max(axis=1) / unit
        measured += [
            compare(found[i], as_tensor(truth[i]), float(unit[i]), float(bounds[i]))
            for i in range(STARTS)
        ]
    return worst(measured)


def _graded(trial: Trial, module: ActionModule, rollout: tuple) -> Measured:
    start, tracks, looks = rollout
    start.position.requires_grad_()
    start.pose.requires_grad_()
    with trial.mixed():
        last = _played(module, start, tracks, looks)
    total = (last.position / trial["scale"]).sum() + last.pose.sum()
    return finite(*gradients(total, [start.position, start.pose, *module.parameters()]))


def slow_rollout(
    weights: Weights, config: ActionConfig, start: PlayerState, given: tuple, shake: float
) -> dict[str, np.ndarray]:
    """R in float64, from the equations of an LSTM cell, twice: as it is, and shaken.

    Args:
        weights: R's tensors by name.
        config: What R sees and predicts; one LSTM layer.
        start: First states.
        given: Action tracks (batch steps), and camera rotations (batch 3 3).
        shake: Deviation of the relative noise on what the second one predicts.

    Returns:
        Last positions and poses and the paths' lengths; first as they are, then shaken.
    """
    tracks, looks = (np.concatenate([each, each]) for each in given)
    state = [start.position, start.pose, start.style, start.facing]
    position, pose, style, heading = (np.tile(s.double().numpy().T, 2).T for s in state)
    hidden, cell = (np.tile(weights[f"initial_{n}"][0], (len(pose), 1)) for n in ("hidden", "cell"))
    scale, path = np.array(config.position_scale), np.zeros(len(pose))
    noise = np.random.default_rng(0)
    kept = np.arange(len(pose))[:, None] < len(pose) // 2

    def shaken(values: np.ndarray) -> np.ndarray:
        return values * np.where(kept, 1.0, 1.0 + shake * noise.standard_normal(values.shape))

    for actions in tracks.T:
        action = np.eye(config.actions)[actions]
        place = position / scale
        seen = [np.tanh(place) if config.bounded_positions else place]
        if config.sees_heading:
            seen.append(np.stack([np.sin(heading), np.cos(heading)], axis=1))
        if config.predict_style:
            seen.append(style)
        unvaried = np.zeros((len(pose), config.variability))
        entering = np.concatenate([*seen, pose, action, unvaried], axis=1)
        hidden, cell = _lstm(weights, entering, hidden, cell)
        read = shaken(np.maximum(_linear(weights, "hidden", hidden), 0))
        movement = _linear(weights, "movement", read) + action @ weights["direct_movement.weight"].T
        step = shaken(np.einsum("bwm,bm->bw", _axes(config, looks, heading), movement))
        position[:, :2] += step * config.movement_scale
        path += np.abs(step).max(axis=1) * config.movement_scale
        pose = shaken(_linear(weights, "pose", read))
        if config.predict_style:
            style = _linear(weights, "style", read)
        if config.predict_heading:
            turn = shaken(_linear(weights, "turn", read))
            heading = heading + np.arctan2(turn[:, 0], turn[:, 1])
    return {"position": position, "pose": pose, "path": path}


def _axes(config: ActionConfig, looks: np.ndarray, heading: np.ndarray) -> np.ndarray:
    """Right and forward on the ground, as columns."""
    forward = looks[:, :2, 2]
    if config.movement_frame == "object":
        forward = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    forward = forward / np.linalg.norm(forward, axis=1, keepdims=True)
    right = np.stack([forward[:, 1], -forward[:, 0]], axis=1)
    return np.stack([right, forward], axis=2)


def _lstm(
    weights: Weights, entering: np.ndarray, hidden: np.ndarray, cell: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    gates = entering @ weights["cells.0.weight_ih"].T + hidden @ weights["cells.0.weight_hh"].T
    gates = gates + weights["cells.0.bias_ih"] + weights["cells.0.bias_hh"]
    enter, forget, new, out = np.split(gates, 4, axis=1)
    cell = _sigmoid(forget) * cell + _sigmoid(enter) * np.tanh(new)
    return _sigmoid(out) * np.tanh(cell), cell


def _linear(weights: Weights, name: str, rows: np.ndarray) -> np.ndarray:
    return rows @ weights[f"{name}.weight"].T + weights[f"{name}.bias"]


def _sigmoid(values: np.ndarray) -> np.ndarray:
    return 0.5 * (1 + np.tanh(values / 2))


def _rolling(design: str) -> Case:
    points = ((10_000, 1.0), (100, 1e6), (100, 1e-3), (1, 1.0))
    return Case(
        f"rollout of 10,000 steps, {design}",
        {"steps": Spread((1.0, 10_000.0), "whole"), "scale": Spread((1e-3, 1e6))},
        partial(roll_out, design),
        "of the way gone: 8 eps + 1 eps32 a step + what roundings do to the rollout in float64",
        draws=0,
        examples=2,
        tried=tuple({"steps": float(steps), "scale": scale} for steps, scale in points),
    )


ROLLOUT = tuple(_rolling(design) for design in DESIGNS)
