"""LPIPS and FID proper, for users who have the weights; nothing is downloaded.

FVD proper is not offered: the I3D network is passed around as TorchScript or as pickles, and both
run code when they are opened. FVD-R stands in (`random_features`).
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from pe_runtime.contract.errors import CheckpointError, ConfigError
from pe_runtime.interop.lpips_files import CHANNELS, read_heads
from pe_runtime.vgg import VggFeatures, load_vgg


@dataclass(frozen=True)
class WeightFiles:
    """Files of the user's that make figures bear their published names.

    Attributes:
        vgg: VGG16 weights (see `pe_runtime.vgg.load_vgg`).
        lpips_heads: The linear heads of LPIPS 0.1 for VGG, `weights/v0.1/vgg.pth` of its wheel.
        inception: The Inception weights of torch-fidelity, for FID through torchmetrics.
    """

    vgg: Path | None = None
    lpips_heads: Path | None = None
    inception: Path | None = None


class Lpips:
    """LPIPS (Zhang et al. 2018), version 0.1 with VGG16: sum over layers of w . |f^ - g^|^2.

    Args:
        network: VGG16 with the layers relu1_2, relu2_2, relu3_3, relu4_3 and relu5_3.
        heads: (1, channels, 1, 1) weights of each layer.

    Raises:
        CheckpointError: Heads and layers do not fit each other.
    """

    def __init__(self, network: VggFeatures, heads: list[Tensor]) -> None:
        found = tuple(each.shape[1] for each in heads)
        if network.design != "vgg16" or network.channels != found:
            raise CheckpointError(
                f"LPIPS needs VGG16 and heads of {CHANNELS} channels; found "
                f"{network.design} of {network.channels} and heads of {found}"
            )
        self.network, self.heads = network.eval(), heads

    @torch.inference_mode()
    def distance(
        self,
        picture: Float[np.ndarray, "height width 3"],
        reference: Float[np.ndarray, "height width 3"],
    ) -> float:
        """LPIPS of a pair of pictures in [0, 1]."""
        pair = torch.from_numpy(np.stack([picture, reference])).float().permute(0, 3, 1, 2)
        total = 0.0
        for features, head in zip(self.network(pair), self.heads, strict=True):
            unit = features / (features.norm(dim=1, keepdim=True) + 1e-10)
            squares = (unit[:1] - unit[1:]).square()
            total += float(nn.functional.conv2d(squares, head).mean())
        return total


def load_lpips(files: WeightFiles) -> Lpips | None:
    """LPIPS from the user's files; None if neither was named.

    Raises:
        ConfigError: Only one of the two files was named.
        CheckpointError: A file is missing or holds something else.
    """
    if files.vgg is None and files.lpips_heads is None:
        return None
    if files.vgg is None or files.lpips_heads is None:
        raise ConfigError("LPIPS needs two files: --vgg (VGG16) and --lpips-heads (its heads)")
    network = load_vgg(files.vgg, ("relu1_2", "relu2_2", "relu3_3", "relu4_3", "relu5_3"))
    return Lpips(network, read_heads(files.lpips_heads))


class InceptionFeatures:
    """FID's features of frames, through torchmetrics and torch-fidelity.

    Args:
        weights: torch-fidelity's Inception file.

    Raises:
        CheckpointError: No such file.
        ConfigError: torchmetrics or torch-fidelity is not installed.
    """

    def __init__(self, weights: Path) -> None:
        if not weights.is_file():
            raise CheckpointError(f"no Inception weights at {weights}")
        try:
            from torchmetrics.image.fid import NoTrainInceptionV3

            self.network = NoTrainInceptionV3("inception-v3-compat", ["2048"], str(weights))
        except (ImportError, ModuleNotFoundError) as problem:
            raise ConfigError(
                "FID needs torchmetrics and torch-fidelity: "
                "pip install 'playable-environments[metrics]' torch-fidelity"
            ) from problem

    @torch.inference_mode()
    def of_frames(self, pictures: Float[np.ndarray, "time height width 3"]) -> np.ndarray:
        """(time, 2048) features of frames in [0, 1]."""
        bytes_ = np.clip(pictures * 255 + 0.5, 0, 255).astype(np.uint8).transpose(0, 3, 1, 2)
        features = self.network(torch.from_numpy(np.ascontiguousarray(bytes_)))
        return features.numpy().astype(np.float64)
