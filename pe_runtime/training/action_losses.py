"""Losses of the action module (paper, Sec. 3.4), as pure functions of states and probabilities."""

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
    rebuilt: Float[Tensor, "batch time code"], encoded: Float[Tensor, "batch time code"]
) -> Float[Tensor, ""]:
    """Mean squared difference of codes (poses, styles) over steps after the first."""
    return _mean_square((rebuilt - encoded)[:, 1:])


def mutual_information(
    first: Float[Tensor, "samples actions"], second: Float[Tensor, "samples actions"]
) -> Float[Tensor, ""]:
    """Mutual information in nats of the actions that A sees in two versions of the same samples.

    With P = mean_n p_n q_n^T, made symmetric as (P + P^T) / 2, and its marginal m:
        MI = sum_ij P_ij (log P_ij - log m_i - log m_j)
    It is 0 for independent or constant actions and log K when both agree on K equally frequent
    ones. Zero probabilities contribute nothing (clamped inside the logarithms only).

    Args:
        first: p, probabilities from the encoded states.
        second: q, probabilities from the rebuilt states.

    Returns:
        A scalar; 0 without samples.
    """
    joint = first.T @ second / max(first.shape[0], 1)
    joint = (joint + joint.T) / 2
    marginal = joint.sum(dim=1)
    ratio = _log(joint) - _log(marginal)[:, None] - _log(marginal)[None, :]
    return (joint * ratio).sum()


def soft_delta_mse(
    probabilities: Float[Tensor, "samples actions"], moves: Float[Tensor, "samples axes"]
) -> Float[Tensor, ""]:
    """Share of the movements' variance that the actions leave unexplained (the paper's L_Delta).

    With mu_k = sum_j p_jk D_j / sum_j p_jk:
        L = 1 / (J Var(D)) sum_j sum_k p_jk |D_j - mu_k|^2,   Var(D) = 1/J sum_j |D_j - mean D|^2
    The paper prints the sum without 1/J; with it the value does not depend on the batch and is the
    Delta-MSE in [0, 1] when the p are one-hot. Actions that nobody takes have no mean and cost
    nothing; movements that are all equal (Var = 0) give 0.

    Args:
        probabilities: p, rows that sum to 1.
        moves: D, one movement per row, any unit.
    """
    if moves.shape[0] == 0:
        return probabilities.sum()
    mass = probabilities.sum(dim=0)
    centres = (probabilities.T @ moves) / mass.clamp_min(SMALLEST)[:, None]
    distance = (moves[:, None] - centres[None]).square().sum(dim=-1)
    variance = (moves - moves.mean(dim=0)).square().sum(dim=-1).mean()
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
