"""A `.pth.tar` of the authors' release, read without running anything that it holds."""

import pickle
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from pe_runtime.contract.errors import CheckpointError

PARALLEL = "module."
"""Prefix of all names where a model was stored inside DataParallel."""

ENVIRONMENT = "environment_model."
"""Prefix of the environment model's copy within a playable model."""

ACTIONS = ("object_animation_models.", "discriminator_models.")
SYNTHESIS = ("object_composer.", "object_encoders.", "object_parameters_encoders.")


@dataclass(frozen=True)
class OfficialFile:
    """Weights of one file of theirs.

    Attributes:
        path: Where they were read.
        step: Training step, if the file says.
        environment: Entries of the environment model (stage 2); empty where there are none.
        actions: Entries of the playable model without that copy (stage 3); may be empty.
    """

    path: Path
    step: int | None
    environment: Mapping[str, Tensor]
    actions: Mapping[str, Tensor]


def read_official_file(path: str | Path) -> OfficialFile:
    """Read a stage-2 or stage-3 checkpoint of theirs.

    Raises:
        CheckpointError: No such file, damaged, no such checkpoint, or something that wants to be
            executed while it is read.
    """
    path = Path(path)
    content = _load(path)
    model = content.get("model") if isinstance(content, Mapping) else None
    if not isinstance(model, Mapping) or not model:
        found = f"keys {', '.join(map(str, content))}" if isinstance(content, Mapping) else ""
        raise CheckpointError(
            f"{path} is no checkpoint of the authors' release: expected a dictionary with the "
            f"weights under 'model', found {found or type(content).__name__}"
        )
    wrong = [str(n) for n, t in model.items() if not isinstance(n, str) or not torch.is_tensor(t)]
    if wrong:
        raise CheckpointError(f"{path}: 'model' holds something else than tensors: {wrong[0]}")
    tensors = {name.removeprefix(PARALLEL): tensor for name, tensor in model.items()}
    copy = {n.removeprefix(ENVIRONMENT): t for n, t in tensors.items() if n.startswith(ENVIRONMENT)}
    own = {n: t for n, t in tensors.items() if not n.startswith(ENVIRONMENT)}
    step = content.get("step")
    step = step if isinstance(step, int) else None
    if copy or any(name.startswith(ACTIONS) for name in own):
        return OfficialFile(path, step, copy, own)
    if any(name.startswith(SYNTHESIS) for name in own):
        return OfficialFile(path, step, own, {})
    raise CheckpointError(f"{path}: {_what_it_is(own)}")


def _load(path: Path) -> object:
    if not path.is_file():
        raise CheckpointError(f"no checkpoint at {path}")
    try:
        with warnings.catch_warnings():
            # About pickle protocols that it may not understand; if so, it refuses.
            warnings.simplefilter("ignore")
            return torch.load(path, map_location="cpu", weights_only=True)
    except pickle.UnpicklingError as problem:
        raise CheckpointError(
            f"{path} is refused: it is no file of weights, or it holds more than weights, which "
            f"reading would execute ({_first_line(problem)})"
        ) from problem
    except (RuntimeError, OSError, EOFError, ValueError, KeyError, IndexError) as problem:
        raise CheckpointError(
            f"{path} is damaged or no checkpoint ({_first_line(problem)}); copy it again"
        ) from problem


def _what_it_is(tensors: Mapping[str, Tensor]) -> str:
    if all(name.startswith(("encoder.", "decoder.")) for name in tensors):
        return (
            "this is a feature renderer of stage 1; it is part of every stage-2 checkpoint, give "
            "that one"
        )
    return (
        "its weights are not those of an environment or playable model (first entry: "
        f"{next(iter(tensors))!r}); give a stage-2 or stage-3 checkpoint of the release"
    )


def _first_line(problem: Exception) -> str:
    lines = [line.strip() for line in str(problem).splitlines() if line.strip()]
    telling = [line for line in lines if "Unsupported" in line or "GLOBAL" in line]
    return (telling or lines or [type(problem).__name__])[0]
