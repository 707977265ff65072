"""Stress of the action module's losses and of drawing actions, as functions of tensors."""

import numpy as np
import torch
from torch import Tensor

from pe_runtime.action.sampling import Noise, Sampling, sample_actions
from pe_runtime.action.state_action_network import followed_centroids
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
from pe_runtime.benchmark.stress_reference import as_array, shared_information, unexplained
from pe_runtime.training.action_losses import (
    discriminator_loss,
    generator_loss,
    joint_probabilities,
    mutual_information,
    soft_delta_mse,
    variability_divergence,
)

ACTIONS = 5
KINDS = ("soft", "one-hot", "always one action", "zero", "nearly zero")
MOVES = ("ordinary", "constant", "nearly constant", "standing")
RUNNING = ("none", "uniform", "zero")


def probabilities(trial: Trial, generator: torch.Generator) -> Tensor:
    """Rows of probabilities of the trial's kind."""
    samples, kind = trial.count("samples"), KINDS[trial.count("kind")]
    logits = torch.randn(samples, ACTIONS, generator=generator)
    found = torch.softmax(logits, dim=-1)
    if kind == "one-hot":
        found = torch.nn.functional.one_hot(logits.argmax(dim=-1), ACTIONS).float()
    elif kind == "always one action":
        found = torch.eye(ACTIONS)[torch.zeros(samples, dtype=torch.long)]
    elif kind == "zero":
        found = torch.zeros_like(found)
    elif kind == "nearly zero":
        found = torch.softmax(40 * logits, dim=-1)
    return found.to(trial.dtype).requires_grad_()


def explain_movement(trial: Trial) -> Outcome:
    """The movements' variance that actions leave unexplained, also where there is none."""
    generator = trial.generator()
    given = probabilities(trial, generator)
    moves = torch.randn(len(given), 2, generator=generator)
    kind = MOVES[trial.count("moves")]
    if kind in ("constant", "nearly constant"):
        step = 1e-3 if kind == "nearly constant" else 0.0
        moves = 0.3 + torch.tensor([0.37, -1.2]) + step * moves
    elif kind == "standing":
        moves = torch.zeros_like(moves)
    moves = (moves * trial["scale"]).to(trial.dtype).requires_grad_()
    loss = soft_delta_mse(given, moves, trial["slack"])
    truth = unexplained(as_array(given), as_array(moves), trial["slack"])
    largest = float(moves.detach().abs().max()) if len(moves) else 0.0
    # Movements, and what they differ by, are known to within eps of the largest.
    unit = (1 + truth.share) * min(1 + largest * truth.sensitivity, 1 / trial.epsilon)
    slopes = gradients(loss, (given, moves))
    wanted = torch.tensor(truth.share, dtype=torch.float64)
    forward = compare(loss, wanted, unit, 8 * trial.epsilon)
    return Outcome(forward, finite(*slopes))


def share_information(trial: Trial) -> Outcome:
    """Mutual information of two versions of an action, with actions that nobody takes."""
    generator = trial.generator()
    first, second = (probabilities(trial, generator) for _ in range(2))
    running, kind = None, RUNNING[trial.count("running")]
    if kind != "none":
        table = torch.full((ACTIONS, ACTIONS), ACTIONS**-2.0 * (kind == "uniform"))
        running = table.to(trial.dtype)
    joint = joint_probabilities(first, second, running, 0.8 if running is not None else 0.0)
    found = mutual_information(joint)
    rows = [as_array(each) for each in (first, second)]
    table = rows[0].T @ rows[1] / max(len(rows[0]), 1)
    table = (table + table.T) / 2
    if running is not None:
        table = 0.8 * as_array(running) + 0.2 * table
    wanted, size = shared_information(table)
    forward = compare(found, torch.tensor(wanted).double(), 1.0 + size, 8 * trial.epsilon)
    return Outcome(forward, finite(*gradients(found, (first, second))))


def diverge(trial: Trial) -> Outcome:
    """Divergence of the variability, and D's losses, of numbers of any size."""
    generator = trial.generator()
    spread = trial["size"] * torch.randn(2, 3, 4, 2, generator=generator).to(trial.dtype)
    mean, log_variance = spread.requires_grad_().unbind(0)
    log_variance = log_variance.clamp(-10.0, 10.0)
    logits = mean[:, 0, 0]
    values = [
        variability_divergence(mean, log_variance),
        discriminator_loss(logits, -logits),
        generator_loss(logits),
    ]
    m, lv, x = (as_array(each) for each in (mean, log_variance, logits))
    positive = np.logaddexp(0, -x).mean()
    wanted = [0.5 * (m**2 + np.exp(lv) - lv - 1).sum(-1).mean(), 2 * positive, positive]
    measured = [
        compare(value, torch.tensor(exact).double(), 1 + abs(exact), 8 * trial.epsilon)
        for value, exact in zip(values, wanted, strict=True)
    ]
    return Outcome(worst(measured), finite(*gradients(sum(values), (spread,))))


def draw_actions(trial: Trial) -> Outcome:
    """Actions from logits of any size: rows of probabilities, and one-hot ones."""
    logits = trial["size"] * torch.randn(40, ACTIONS, generator=trial.generator())
    logits[0], logits[1, 1:] = 0.0, -trial["size"]
    logits = logits.to(trial.dtype).requires_grad_()

    def drawn(given: Tensor, soft: bool) -> Tensor:
        noise = Noise(trial.generator())
        return sample_actions(given, Sampling(trial["temperature"], 0.0, 0.0, noise, soft))

    soft, hard = drawn(logits, True), drawn(logits, False)
    wanted = drawn(logits.detach().double(), True)
    # exp() turns roundings of its argument into shares of its value.
    reach = 1 + (20 + float(logits.detach().abs().max())) / trial["temperature"]
    bound = within_one(8 * trial.epsilon * reach)
    rows = torch.ones(40, dtype=torch.float64)
    forward = worst(
        [
            compare(soft, wanted, 1.0, bound),
            compare(soft.sum(dim=-1), rows, 1.0, 8 * trial.epsilon),
            compare(hard.detach().max(dim=-1).values, rows, 1.0, 2 * trial.epsilon),
        ]
    )
    towards = torch.randn(40, ACTIONS, generator=trial.generator()).to(trial.dtype)
    total = (soft * towards).sum() + (hard * towards).sum()
    return Outcome(forward, finite(*gradients(total, (logits,))))


def follow_centroids(trial: Trial) -> Outcome:
    """Centroids of actions that few or no samples take."""
    generator = trial.generator()
    given = probabilities(trial, generator).detach()
    directions = (trial["scale"] * torch.randn(len(given), 3, generator=generator)).to(trial.dtype)
    before = torch.randn(ACTIONS, 3, generator=generator).to(trial.dtype)
    found = followed_centroids(before, given, directions, 0.1)
    shares, ways, wanted = as_array(given), as_array(directions), as_array(before).copy()
    for action in np.flatnonzero(shares.sum(axis=0) > 1e-12):
        share = shares[:, action] / shares[:, action].sum()
        wanted[action] = 0.9 * wanted[action] + 0.1 * share @ ways
    unit = 1.0 + float(np.abs(ways).max(initial=0.0))
    return Outcome(compare(found, torch.from_numpy(wanted), unit, 8 * trial.epsilon))


_SAMPLES = Spread((1.0, 2.0, 64.0), "whole")
_KINDS = {"kind": one_of(KINDS), "samples": _SAMPLES}

LOSSES = (
    Case(
        "variance left unexplained by actions",
        _KINDS
        | {
            "moves": one_of(MOVES),
            "scale": Spread((1e-3, 1.0, 1e6)),
            "slack": Spread((0.0, 1e-4), "linear"),
        },
        explain_movement,
        "8 eps of 1 + largest movement by deviation, as far as that is known at all",
        draws=24,
        examples=30,
    ),
    Case(
        "information shared by actions",
        _KINDS | {"running": one_of(RUNNING)},
        share_information,
        "8 eps of 1 + the sizes of the summed terms",
        draws=12,
        examples=20,
    ),
    Case(
        "divergence and adversarial losses",
        {"size": Spread((0.0, 1e-6, 1.0, 1e3, 1e6))},
        diverge,
        "8 eps of 1 + the loss",
    ),
    Case(
        "drawing actions",
        {"size": Spread((0.0, 1.0, 1e4, 1e30)), "temperature": Spread((1e-3, 1.0, 10.0))},
        draw_actions,
        "8 eps of the largest logit by temperature, above 1: finite; rows sum to 1 within 8 eps",
    ),
    Case(
        "centroids of actions",
        _KINDS | {"scale": Spread((1e-3, 1.0, 1e6))},
        follow_centroids,
        "8 eps of 1 + the largest direction",
    ),
)
