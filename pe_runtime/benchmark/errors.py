"""How far a picture is from the true one, in four figures."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float

from pe_runtime.training.perceptual import RandomFeatures


@dataclass(frozen=True)
class PictureError:
    """Differences of sRGB values in [0, 1].

    Attributes:
        max_abs: The largest.
        rmse: Root of the mean square.
        psnr: The same in dB, peak 1; None where the pictures are equal.
        perceptual: Distance of fixed random convolution features (training.perceptual).
    """

    max_abs: float
    rmse: float
    psnr: float | None
    perceptual: float


def picture_error(
    picture: Float[np.ndarray, "height width 3"], truth: Float[np.ndarray, "height width 3"]
) -> PictureError:
    """Errors of one picture, computed in float64."""
    apart = picture.astype(np.float64) - truth
    rmse = float(np.sqrt((apart**2).mean()))
    features = RandomFeatures().double()
    pictures = (torch.from_numpy(p.astype(np.float64)).permute(2, 0, 1) for p in (picture, truth))
    with torch.no_grad():
        perceptual = features(*(p[None] for p in pictures))
    return PictureError(float(np.abs(apart).max()), rmse, psnr_of(rmse), float(perceptual))


def pooled(errors: Sequence[PictureError]) -> PictureError:
    """Errors of several pictures of one size as one: the worst pixel of all, means of the rest."""
    rmse = math.sqrt(sum(each.rmse**2 for each in errors) / len(errors))
    perceptual = sum(each.perceptual for each in errors) / len(errors)
    return PictureError(max(each.max_abs for each in errors), rmse, psnr_of(rmse), perceptual)


def psnr_of(rmse: float) -> float | None:
    """Peak signal-to-noise ratio in dB, peak 1; None without any noise."""
    return -20.0 * math.log10(rmse) if rmse > 0 else None
