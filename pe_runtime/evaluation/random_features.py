"""Distances between pictures and sets of pictures that need no file: fixed random filters.

They stand in for LPIPS, FID and FVD, whose networks cannot be shipped, and are named LPIPS-R, FD-R
and FVD-R. Their numbers say which of two models is closer; they are not comparable with published
ones. The filters are others than those of the perceptual loss in training (another seed and other
widths), so that nothing is measured by what it was trained on.
"""

import math

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

SEED = 20220606
WIDTHS = (24, 48, 72, 96)
"""Channels at full, half, quarter and eighth resolution."""
KEPT = 32
"""Numbers per frame or clip that enter a Frechet distance: about 100 samples fix their Gaussian."""
QUIET = 0.05
"""Length of a feature below which it counts less and less: flat areas are no texture."""
SCALE = 100.0
"""Makes common Frechet distances numbers between 0.1 and 100."""


class RandomFilters(nn.Module):
    """A pyramid of random 3x3 filters without mean, orthogonal within a layer, ReLUs between.

    Args:
        narrow: Channels of the pictures.
        seed: Of the filters; the same seed is the same distance on every machine.
    """

    def __init__(self, narrow: int = 3, seed: int = SEED) -> None:
        super().__init__()
        generator = torch.Generator().manual_seed(seed)
        self.filters = nn.ParameterList()
        for wide in WIDTHS:
            filters = torch.randn(wide, narrow, 3, 3, generator=generator)
            filters = filters - filters.mean(dim=(2, 3), keepdim=True)
            filters = filters / filters.flatten(1).norm(dim=1)[:, None, None, None]
            self.filters.append(nn.Parameter(filters, requires_grad=False))
            narrow = wide
        self.projection = nn.Parameter(
            torch.randn(KEPT, 2 * sum(WIDTHS), generator=generator) / math.sqrt(KEPT),
            requires_grad=False,
        )

    def forward(self, images: Float[Tensor, "frames channels height width"]) -> list[Tensor]:
        """Features of every layer, (frames, width of the layer, rows, columns)."""
        found, hidden = [], images
        for filters in self.filters:
            hidden = torch.relu(nn.functional.conv2d(hidden, filters, padding=1))
            found.append(hidden)
            if min(hidden.shape[-2:]) >= 4:
                hidden = nn.functional.avg_pool2d(hidden, 2)
        return found

    def pooled(self, images: Float[Tensor, "frames channels height width"]) -> Tensor:
        """(frames, KEPT): means and deviations of all features over the picture, projected."""
        layers = self(images)
        means = [each.mean(dim=(2, 3)) for each in layers]
        spreads = [each.std(dim=(2, 3), unbiased=False) for each in layers]
        return torch.cat([*means, *spreads], dim=1) @ self.projection.T * SCALE


class RandomPerception:
    """LPIPS-R of picture pairs and the features behind FD-R and FVD-R."""

    def __init__(self) -> None:
        self.filters = RandomFilters().eval()

    @torch.inference_mode()
    def distance(
        self,
        picture: Float[np.ndarray, "height width 3"],
        reference: Float[np.ndarray, "height width 3"],
    ) -> float:
        """LPIPS-R: mean over layers and positions of |f / |f| - g / |g||^2, in [0, 2].

        Features are normalised to unit length at each position as in LPIPS, except that lengths
        below `QUIET` are taken as `QUIET`.
        """
        pair = self.filters(_channels_first(np.stack([picture, reference])))
        distances = []
        for features in pair:
            length = features.norm(dim=1, keepdim=True).clamp(min=QUIET)
            mine, theirs = features / length
            distances.append(float((mine - theirs).square().sum(dim=0).mean()))
        return float(np.mean(distances))

    @torch.inference_mode()
    def of_frames(self, pictures: Float[np.ndarray, "time height width 3"]) -> np.ndarray:
        """(time, KEPT) features of single frames, for FD-R."""
        return self.filters.pooled(_channels_first(pictures)).numpy().astype(np.float64)

    @torch.inference_mode()
    def of_clips(
        self, pictures: Float[np.ndarray, "time height width 3"], length: int
    ) -> np.ndarray:
        """(clips, KEPT) features of successive clips of equal length, for FVD-R.

        One half each: mean features of a clip's frames, and of the differences between neighbours,
        which alone see movement (twice as strong, since they are small). What does not fill a clip
        at the end is left out.
        """
        images, clips = _channels_first(pictures), []
        for start in range(0, len(images) - length + 1, length):
            clip = images[start : start + length]
            still = self.filters.pooled(clip).mean(dim=0)[: KEPT // 2]
            moving = self.filters.pooled(2.0 * clip.diff(dim=0)).mean(dim=0)[: KEPT // 2]
            clips.append(torch.cat([still, moving]).numpy().astype(np.float64))
        return np.array(clips).reshape(len(clips), KEPT)


def _channels_first(pictures: np.ndarray) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(pictures.transpose(0, 3, 1, 2))).float()
