"""What pure functions should give: slow, plain, in float64 or exact, and sharing no code with them.

Weights come from a product of what every sample lets through (the runtime exponentiates a sum), and
boxes are met in rational numbers, which round nothing.
"""

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor


def walked_weights(
    thickness: Float[np.ndarray, "rays samples"],
) -> tuple[Float[np.ndarray, "rays samples"], Float[np.ndarray, "rays samples"]]:
    """Weights of samples along rays, w_i = prod_{j<i} e^-tau_j (1 - e^-tau_i), and the products."""
    passing = np.exp(-thickness)
    light = np.ones_like(passing)
    light[:, 1:] = np.cumprod(passing[:, :-1], axis=1)
    return light * -np.expm1(-thickness), light


def walked_gradients(
    thickness: Float[np.ndarray, "rays samples"], towards: Float[np.ndarray, "rays samples"]
) -> Float[np.ndarray, "rays samples"]:
    """Gradient of sum c w: what gets past a sample, less what it hides, c T_i+1 - sum_{j>i} c w."""
    weights, light = walked_weights(thickness)
    return towards * light * np.exp(-thickness) - behind(towards * weights)


def behind(values: Float[np.ndarray, "rays samples"]) -> Float[np.ndarray, "rays samples"]:
    """Sum over all later samples."""
    later = np.zeros_like(values)
    later[:, :-1] = values[:, :0:-1].cumsum(axis=1)[:, ::-1]
    return later


def gaps_of(
    depth: Float[np.ndarray, "rays samples"], last: float
) -> Float[np.ndarray, "rays samples"]:
    """Distance of sorted samples to the next one; that of the last is given."""
    return np.diff(depth, axis=1, append=depth[:, -1:] + last)


def exact_passage(
    origin: Tensor, direction: Tensor, low: Tensor, high: Tensor, near: float
) -> tuple[float, float] | None:
    """Entry and exit of one ray, computed in rational numbers; None where it misses the box.

    A ray in the plane of a face misses, and so does every ray for a box without an inside.
    """
    entry, leave = Fraction(near), None
    for o, d, a, b in zip(*map(_rational, (origin, direction, low, high)), strict=True):
        if a >= b or (d == 0 and not a < o < b):
            return None
        if d != 0:
            first, last = sorted(((a - o) / d, (b - o) / d))
            entry = max(entry, first)
            leave = last if leave is None else min(leave, last)
    if leave is None or leave <= entry or leave > Fraction(1e300):
        return None
    return float(entry), float(leave)


def _rational(numbers: Tensor) -> list[Fraction]:
    return [Fraction(each) for each in numbers.tolist()]


def shared_information(joint: Float[np.ndarray, "actions actions"]) -> tuple[float, float]:
    """Mutual information (nats) of a joint table, and the sum of its terms' sizes."""
    margin, total, size = joint.sum(axis=1), 0.0, 0.0
    for row, column in zip(*np.nonzero(joint), strict=True):
        share = joint[row, column]
        logs = [math.log(each) for each in (share, margin[row], margin[column])]
        total += share * (logs[0] - logs[1] - logs[2])
        size += share * sum(map(abs, logs))
    return total, size


@dataclass(frozen=True)
class Unexplained:
    """Share of the movements' variance that actions leave unexplained.

    Attributes:
        share: The loss.
        sensitivity: By how much it changes for a unit that movements change by, at most.
    """

    share: float
    sensitivity: float


def unexplained(
    probabilities: Float[np.ndarray, "samples actions"],
    moves: Float[np.ndarray, "samples axes"],
    slack: float,
) -> Unexplained:
    """The loss from its definition, in extended precision."""
    moves, samples = np.asarray(moves, dtype=np.longdouble), max(len(moves), 1)
    spread = ((moves - moves.mean(axis=0)) ** 2).sum() / samples
    total = np.longdouble(0.0)
    for shares in np.asarray(probabilities, dtype=np.longdouble).T:
        if shares.sum() > 0:
            centre = (shares[:, None] * moves).sum(axis=0) / (shares.sum() + slack)
            total += (shares * ((moves - centre) ** 2).sum(axis=1)).sum() / samples
    variance = max(spread + moves.shape[1] * slack, np.longdouble(1e-12))
    share = total / variance
    return Unexplained(
        float(share), float(2 * (np.sqrt(total) + share * np.sqrt(spread)) / variance)
    )


def as_array(values: Tensor) -> np.ndarray:
    """A tensor's numbers in float64."""
    return values.detach().double().numpy()


def as_tensor(values: np.ndarray) -> Tensor:
    """Numbers back as a float64 tensor."""
    return torch.from_numpy(np.ascontiguousarray(values, dtype=np.float64))
