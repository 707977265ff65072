"""Other colours for recorded sequences: what is learnt of style must not end at the wardrobe."""

import torch
from jaxtyping import Float
from torch import Tensor

STEEPEST = 1.4
"""Largest exponent of a channel's curve; the smallest is its reciprocal."""


def recolour(
    images: Float[Tensor, "frames 3 height width"], frames: int, share: float
) -> Float[Tensor, "frames 3 height width"]:
    """Give some sequences other colours: channels change places, and each gets a curve x^g.

    Both map [0, 1] onto itself, so nothing is clipped. All frames of a sequence are changed alike,
    since neighbours in time share their styles; and picture and target are the same frame.

    Args:
        images: Pictures in [0, 1]; frames of a sequence are neighbours.
        frames: Frames of each sequence.
        share: Of the sequences that are changed, in [0, 1]; 0 returns the very pictures.
    """
    if share <= 0:
        return images
    count = images.shape[0] // frames
    chosen = (torch.rand(count) < share)[:, None]
    orders = torch.argsort(torch.rand(count, 3), dim=1)
    exponents = STEEPEST ** (2 * torch.rand(count, 3) - 1)
    orders = torch.where(chosen, orders, torch.arange(3)).repeat_interleave(frames, 0)
    exponents = torch.where(chosen, exponents, 1.0).repeat_interleave(frames, 0)
    moved = torch.gather(images, 1, orders.to(images.device)[:, :, None, None].expand_as(images))
    return moved ** exponents.to(images)[:, :, None, None]
