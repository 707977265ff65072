"""Do rebuilt poses move like encoded ones? A discrepancy of distributions, not of sequences.

Whoever is played from one picture walks in a phase and at a pace that nobody can know, so after a
few steps the best guess in the sense of squares is the mean of all phases: legs that stand. What
can be asked for is that windows of poses and actions are distributed as the encoded ones are.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from pe_runtime.action.sampling import Noise

FREQUENCIES = 256
"""Random frequencies per bandwidth and step of the training."""
BANDWIDTHS = (0.35, 0.7, 1.4)
"""Standard deviations of the Gaussian kernels, in medians of the distances of encoded windows."""
COMPARED = 128
"""Windows of which the median distance is taken."""
SMALLEST = 1e-6


def pose_windows(
    poses: Float[Tensor, "batch time pose"],
    actions: Float[Tensor, "batch moves actions"],
    length: int,
    action_scale: float,
) -> Float[Tensor, "windows columns"]:
    """Every window of so many successive poses, with the actions taken in it.

    A row is (pi_t, pi_t+1 - pi_t, .., a_t, ..): the first pose, its changes, and the actions.

    Args:
        poses: Of each sequence.
        actions: One fewer than there are poses, one-hot.
        length: Poses in a window.
        action_scale: What an action weighs beside a pose code.

    Returns:
        No rows if the sequences are shorter than a window.
    """
    count = poses.shape[1] - length + 1
    if count < 1:
        return poses.new_zeros(0, length * poses.shape[2] + (length - 1) * actions.shape[2])
    changes, taken = poses.diff(dim=1), action_scale * actions
    columns = [poses[:, :count]]
    for each in (changes, taken):
        columns += [each[:, start : start + count] for start in range(length - 1)]
    return torch.cat(columns, dim=-1).flatten(0, 1)


def discrepancy(
    encoded: Float[Tensor, "windows columns"],
    rebuilt: Float[Tensor, "others columns"],
    noise: Noise,
) -> Float[Tensor, ""]:
    """Squared maximum mean discrepancy of two sets, summed over three Gaussian kernels.

        MMD^2 = E k(x, x') - 2 E k(x, y) + E k(y, y'),   k(x, y) = exp(-|x - y|^2 / 2 s^2)
    estimated by random Fourier features (Rahimi and Recht 2007): with w ~ N(0, 1/s^2),
    MMD^2 = E_w |mean exp(i w x) - mean exp(i w y)|^2. It is 0 for equal sets.

    Args:
        encoded: x; its median distance is the unit of s.
        rebuilt: y.
        noise: Where the frequencies come from.

    Returns:
        0 if one of the sets is empty.
    """
    if encoded.shape[0] == 0 or rebuilt.shape[0] == 0:
        return encoded.sum() * 0 + rebuilt.sum() * 0
    some = encoded[:COMPARED].detach()
    median = torch.cdist(some, some).median().clamp_min(SMALLEST)
    total = encoded.new_zeros(())
    for share in BANDWIDTHS:
        like = encoded.new_empty(encoded.shape[1], FREQUENCIES)
        frequencies = noise.normal(like) / (share * median)
        total = total + _apart(encoded @ frequencies, rebuilt @ frequencies)
    return total


def _apart(
    first: Float[Tensor, "windows frequencies"], second: Float[Tensor, "others frequencies"]
) -> Float[Tensor, ""]:
    """Mean over frequencies of |mean exp(i first) - mean exp(i second)|^2."""
    real = first.cos().mean(dim=0) - second.cos().mean(dim=0)
    imaginary = first.sin().mean(dim=0) - second.sin().mean(dim=0)
    return (real.square() + imaginary.square()).mean()
