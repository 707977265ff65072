"""Stress of the action module as a whole: short, single, still and far-away sequences.

The truth is the same modules in float64, fed with the same noise.
"""

import copy
from dataclasses import fields

import torch
from torch import Tensor

from pe_runtime.action.discriminator import TemporalDiscriminator
from pe_runtime.action.module import ActionModule, Reconstruction
from pe_runtime.action.movement import ground_axes, moved, movements
from pe_runtime.action.sampling import Noise, Sampling
from pe_runtime.action.sequences import StateSequence
from pe_runtime.benchmark.stress_cases import (
    Case,
    Outcome,
    Spread,
    Trial,
    compare,
    finite,
    gradients,
    one_of,
    within_one,
    worst,
)
from pe_runtime.benchmark.stress_rollout import (
    DESIGNS,
    POSE,
    SINGLE,
    STYLE,
    action_config,
    seeded_module,
)
from pe_runtime.config import ActionConfig
from pe_runtime.training import action_losses as losses

PATHS = ("walking", "constant steps", "standing", "jumping")
VIEWS = ("level", "straight down", "straight up", "nearly down", "rolled")


def rebuild_sequences(trial: Trial) -> Outcome:
    """A reconstruction as in training, with every loss, and the gradients of their sum."""
    config = action_config(DESIGNS[trial.count("design")], trial["scale"])
    module = seeded_module(config, trial.seed)
    judge = _judge(config, trial.seed)
    # Before centroids follow what the modules see.
    precise = copy.deepcopy(module).double(), copy.deepcopy(judge).double()
    sequence = _sequence(trial, config)
    with trial.mixed():
        rebuilt, terms = _trained(module, judge, sequence, trial)
    with torch.no_grad():
        truth, exact = _trained(*precise, _in_double(sequence), trial)
    slopes = gradients(sum(terms.values()), [*module.parameters(), *judge.parameters()])
    away = float(sequence.positions.abs().max()) / trial["scale"]
    # Positions are float32 and leave few digits to a movement far away; where R and A look at
    # places as they are, these enter products too.
    lost = (SINGLE if config.bounded_positions else trial.epsilon) * away
    results = [
        (rebuilt.sequence.positions, truth.sequence.positions, trial["scale"] * (1 + away)),
        (rebuilt.sequence.poses, truth.sequence.poses, 1.0),
        (rebuilt.actions, truth.actions, 1.0),
    ]
    # Where nothing changes its movement, a share of the variance is one of roundings.
    shares = PATHS[trial.count("path")] in ("walking", "jumping")
    for name in exact.keys() - (set() if shares else {"movement"}):
        results.append((terms[name], exact[name], 1 + float(exact[name].abs())))
    bound = within_one(64 * (trial.epsilon + lost))
    measured = [compare(found, other, unit, bound) for found, other, unit in results]
    measured.append(finite(rebuilt.variability, rebuilt.moves, terms["movement"]))
    return Outcome(worst(measured), finite(*slopes))


def _trained(
    module: ActionModule, judge: TemporalDiscriminator, sequence: StateSequence, trial: Trial
) -> tuple[Reconstruction, dict[str, Tensor]]:
    noise = Noise(trial.generator())
    sampling = Sampling(1.0, 0.3, 0.5, noise, soft=True, centroid_rate=0.1)
    rebuilt = module.reconstruct(sequence, sampling)
    again = module.action_network(rebuilt.sequence)
    pair = [each.probabilities.flatten(0, 1) for each in (rebuilt.estimate, again)]
    config, estimate = module.config, rebuilt.estimate
    moves = movements(sequence.positions, sequence.axes(config.movement_frame)).flatten(0, 1)
    seen = rebuilt.actions, estimate.direction
    terms = {
        "position": losses.position_loss(rebuilt.sequence, sequence, config.movement_scale),
        "pose": losses.code_loss(rebuilt.sequence.poses, sequence.poses),
        "heading": losses.heading_loss(rebuilt.sequence.facings, sequence.facings),
        "action": losses.mutual_information(losses.joint_probabilities(*pair)),
        "movement": losses.soft_delta_mse(pair[0], moves),
        "variability": losses.variability_divergence(estimate.mean, estimate.log_variance),
        "adversarial": losses.discriminator_loss(
            judge(sequence, *seen), judge(rebuilt.sequence, *seen)
        ),
    }
    return rebuilt, terms


def _judge(config: ActionConfig, seed: int) -> TemporalDiscriminator:
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return TemporalDiscriminator(config, POSE).eval()


def _sequence(trial: Trial, config: ActionConfig) -> StateSequence:
    generator, batch, time = trial.generator(), trial.count("batch"), trial.count("time")
    path, scale = PATHS[trial.count("path")], trial["scale"]
    start = torch.randn(batch, 1, 3, generator=generator) * scale * (1 + trial["away"])
    steps = 0.3 * scale * torch.randn(batch, time, 3, generator=generator)
    if path == "constant steps":
        steps = steps[:, :1].expand_as(steps)
    elif path == "standing":
        steps = torch.zeros_like(steps)
    elif path == "jumping":
        # Feet near the horizon are found kilometres away.
        steps = steps * torch.where(torch.rand(batch, time, 1, generator=generator) < 0.5, 1e6, 1)
    poses = torch.randn(batch, time, POSE, generator=generator)
    styles = torch.randn(batch, 1, STYLE, generator=generator).expand(-1, time, -1)
    looks = torch.linalg.qr(torch.randn(batch, time, 3, 3, generator=generator)).Q
    headings = torch.randn(batch, time, generator=generator) if config.sees_heading else None
    if path in ("constant steps", "standing"):
        poses, looks = poses[:, :1].expand_as(poses), looks[:, :1].expand_as(looks)
    return StateSequence(start + steps.cumsum(dim=1), styles, poses, looks, headings)


def _in_double(sequence: StateSequence) -> StateSequence:
    values = (getattr(sequence, each.name) for each in fields(sequence))
    return StateSequence(*(None if each is None else each.double() for each in values))


def move_on_ground(trial: Trial) -> Outcome:
    """Movements read from positions and put on them again, under cameras that look anywhere."""
    generator, view = trial.generator(), VIEWS[trial.count("view")]
    looks = torch.linalg.qr(torch.randn(4, 2, 3, 3, generator=generator, dtype=torch.float64)).Q
    if view in ("straight down", "straight up", "nearly down"):
        sign = 1.0 if view == "straight up" else -1.0
        looks = torch.tensor([[1.0, 0, 0], [0, sign, 0], [0, 0, sign]]).double().expand(4, 2, 3, 3)
        slant = 2e-3 if view == "nearly down" else 0.0
        looks = looks.clone()
        looks[..., 1, 2] += slant
    elif view == "level":
        looks = torch.tensor([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]).double().expand(4, 2, 3, 3)
    places = torch.randn(4, 2, 3, generator=generator) * trial["scale"] * (1 + trial["away"])
    places.requires_grad_()
    with trial.mixed():
        axes = ground_axes(looks.float())
        steps = movements(places, axes)
        back = moved(places[:, 0], steps[:, 0], axes[:, 0])
    exact = ground_axes(looks.float().double())[:, 0]
    change = (places[:, 1] - places[:, 0]).detach().double()[:, :2]
    wanted = torch.einsum("bwm,bw->bm", exact, change)
    size = float(places.detach().abs().max())
    bound = 8 * trial.epsilon
    forward = worst(
        [
            compare(steps[:, 0], wanted, size, bound),
            compare(back[:, :2], places[:, 1, :2].double(), size, bound),
        ]
    )
    return Outcome(forward, finite(*gradients(back.sum() / trial["scale"], (places,))))


ACTING = (
    Case(
        "action module: T = 1, batch 1, Var = 0, far away",
        {
            "design": one_of(DESIGNS),
            "batch": Spread((1.0, 3.0), "whole"),
            "time": Spread((1.0, 2.0, 6.0), "whole"),
            "path": one_of(PATHS),
            "scale": Spread((1e-3, 1.0, 1e6)),
            "away": Spread((0.0, 1.0, 1e5)),
        },
        rebuild_sequences,
        "64 eps, and 64 eps32 of the distance (64 eps where it enters products); above 1: finite",
        draws=12,
        examples=8,
    ),
    Case(
        "movements on the ground",
        {"view": one_of(VIEWS), "scale": Spread((1e-3, 1.0, 1e6)), "away": Spread((0.0, 1.0, 1e5))},
        move_on_ground,
        "8 eps of the positions, whose difference a movement is",
    ),
)
