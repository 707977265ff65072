"""The linear heads of LPIPS as its package stores them."""

import pickle
from collections.abc import Mapping
from pathlib import Path

import torch
from torch import Tensor

from pe_runtime.checkpoint import read_tensors
from pe_runtime.contract.errors import CheckpointError

CHANNELS = (64, 128, 256, 512, 512)
"""Of the layers of VGG16 that LPIPS 0.1 compares."""


def read_heads(path: str | Path) -> list[Tensor]:
    """The heads `lin0.model.1.weight` to `lin4.model.1.weight` for VGG16.

    Args:
        path: `weights/v0.1/vgg.pth` of the package `lpips`, or the same names as .safetensors.

    Returns:
        (1, channels, 1, 1) of each layer.

    Raises:
        CheckpointError: The file is missing or holds something else.
    """
    path = Path(path)
    if not path.is_file():
        raise CheckpointError(f"no LPIPS heads at {path}")
    tensors = read_tensors(path) if path.suffix == ".safetensors" else _load(path)
    heads = []
    for index, channels in enumerate(CHANNELS):
        name, shape = f"lin{index}.model.1.weight", (1, channels, 1, 1)
        found = tensors.get(name)
        if not isinstance(found, Tensor) or tuple(found.shape) != shape:
            raise CheckpointError(f"{path}: expected {name} of shape {shape}, the heads of VGG16")
        heads.append(found.float())
    return heads


def _load(path: Path) -> Mapping[str, object]:
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
    except (pickle.UnpicklingError, RuntimeError, OSError, EOFError, ValueError) as problem:
        raise CheckpointError(f"{path} is damaged, or holds more than weights") from problem
    return content if isinstance(content, Mapping) else {}
