"""Losses of the action module (paper, Sec. 3.4), as pure functions of states and probabilities."""

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import softplus

from pe_runtime.action.sequences import StateSequence

SMALLEST = 1e-12
"""Probabilities below this count as this inside logarithms and divisions."""


def position_loss(
    rebuilt: StateSequence, encoded: StateSequence, scale: float
) -> Float[Tensor, ""]:
    """Mean over steps after the first of |x^ - x|^2 / (2 scale^2), on the ground.

    The first state is given and would only dilute the mean. Sequences of one state give 0.

    Args:
        rebuilt: R's states.
        encoded: E's states.
        scale: Metres that count as 1, as a rule those of one movement.
    """
    return _mean_square((rebuilt.positions - encoded.positions)[:, 1:, :2] / scale)


def code_loss(
    rebuilt: Float[Tensor, "batch time code"],
    encoded: Float[Tensor, "batch time code"],
    horizon: float = 0.0,
) -> Float[Tensor, ""]:
    """Mean of exp(-(t - 1) / horizon) |c^_t - c_t|^2 over steps t after the first, from 1.

    Args:
        rebuilt: Codes (poses, styles) of R.
        encoded: Those of E.
        horizon: Steps after which a difference counts 1/e of what it counts at first; 0: all
            steps count alike.
    """
    difference = (rebuilt - encoded)[:, 1:]
    if horizon == 0:
        return _mean_square(difference)
    ages = torch.arange(difference.shape[1], device=difference.device)
    return _mean_square(difference * torch.exp(-0.5 * ages / horizon)[:, None])


def heading_loss(
    rebuilt: Float[Tensor, "batch time"], encoded: Float[Tensor, "batch time"]
) -> Float[Tensor, ""]:
    """Mean squared difference of the headings' sines and cosines over steps after the first.

    Args:
        rebuilt: R's headings, radians.
        encoded: E's headings.
    """
    sines, cosines = rebuilt.sin() - encoded.sin(), rebuilt.cos() - encoded.cos()
    return _mean_square(torch.stack([sines, cosines], dim=-1)[:, 1:])


def joint_probabilities(
    first: Float[Tensor, "samples actions"],
    second: Float[Tensor, "samples actions"],
    running: Float[Tensor, "actions actions"] | None = None,
    memory: float = 0.0,
) -> Float[Tensor, "actions actions"]:
    """How often A sees one action in one version of a sample and one in another version of it.

    P = mean_n p_n q_n^T, made symmetric as (P + P^T) / 2, and with a running estimate
    memory * running + (1 - memory) * P, through whose first part no gradient flows.

    Args:
        first: p, probabilities from the encoded states.
        second: q, probabilities from the rebuilt states.
        running: What the batch before this one gave.
        memory: Its share, in [0, 1).

    Returns:
        A symmetric table that sums to 1; without samples, to `memory`.
    """
    joint = first.T @ second / max(first.shape[0], 1)
    joint = (joint + joint.T) / 2
    return joint if running is None else memory * running.detach() + (1.0 - memory) * joint


def mutual_information(joint: Float[Tensor, "actions actions"]) -> Float[Tensor, ""]:
    """Mutual information in nats of two versions of an action.

    With the marginal m of P:
        MI = sum_ij P_ij (log P_ij - log m_i - log m_j)
    It is 0 for independent or constant actions and log K when both agree on K equally frequent
    ones. Zero probabilities contribute nothing (clamped inside the logarithms only).

    Args:
        joint: P, symmetric; from `joint_probabilities`.
    """
    marginal = joint.sum(dim=1)
    ratio = _log(joint) - _log(marginal)[:, None] - _log(marginal)[None, :]
    return (joint * ratio).sum()


def soft_delta_mse(
    probabilities: Float[Tensor, "samples actions"],
    moves: Float[Tensor, "samples axes"],
    slack: float = 0.0,
) -> Float[Tensor, ""]:
    """Share of the movements' variance that the actions leave unexplained (the paper's L_Delta).

    With mu_k = sum_j p_jk D_j / sum_j p_jk:
        L = 1 / (J Var(D)) sum_j sum_k p_jk |D_j - mu_k|^2,   Var(D) = 1/J sum_j |D_j - mean D|^2
    The paper prints the sum without 1/J; with it the value does not depend on the batch and is the
    Delta-MSE in [0, 1] when the p are one-hot. Actions that nobody takes have no mean and cost
    nothing; movements that are all equal (Var = 0) give 0, and a variance below 1e-12 counts as
    that.

    Args:
        probabilities: p, rows that sum to 1.
        moves: D, one movement per row, any unit.
        slack: Added to the probability of each action before its mean is taken, and to the variance
            of each axis (1e-4 in the training of the paper's authors). It pulls rare actions' means
            to 0 and bounds the loss of objects that stand.
    """
    if moves.shape[0] == 0:
        return probabilities.sum()
    mass = (probabilities.sum(dim=0) + slack).clamp_min(SMALLEST)[:, None]
    # Seen from their mean, whose own rounding is taken off too: the roundings of large movements
    # would be a variance of their own.
    mean = moves.mean(dim=0)
    away = moves - mean
    mean, away = mean + away.mean(dim=0), away - away.mean(dim=0)
    centres = (probabilities.T @ away - slack * mean) / mass
    distance = (away[:, None] - centres[None]).square().sum(dim=-1)
    variance = away.square().sum(dim=-1).mean() + moves.shape[1] * slack
    return (probabilities * distance).sum(dim=-1).mean() / variance.clamp_min(SMALLEST)


def variability_divergence(
    mean: Float[Tensor, "*batch variability"], log_variance: Float[Tensor, "*batch variability"]
) -> Float[Tensor, ""]:
    """KL(N(m, s^2) || N(0, 1)) = (m^2 + s^2 - log s^2 - 1) / 2, summed over v, mean over moves."""
    divergence = 0.5 * (mean.square() + log_variance.exp() - log_variance - 1.0)
    return divergence.sum(dim=-1).sum() / max(divergence[..., 0].numel(), 1)


def discriminator_loss(
    real: Float[Tensor, " batch"], fake: Float[Tensor, " batch"]
) -> Float[Tensor, ""]:
    """L_D = -mean log s(real) - mean log(1 - s(fake)), s the sigmoid of the logits."""
    return softplus(-real).mean() + softplus(fake).mean()


def generator_loss(fake: Float[Tensor, " batch"]) -> Float[Tensor, ""]:
    """L_G = -mean log s(fake): the action module wants to be taken for the encoder."""
    return softplus(-fake).mean()


def _log(value: Tensor) -> Tensor:
    return value.clamp_min(SMALLEST).log()


def _mean_square(difference: Tensor) -> Tensor:
    return difference.square().sum() / max(difference.numel(), 1)
