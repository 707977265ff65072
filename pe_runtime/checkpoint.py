"""Weights on disk: safetensors with one JSON header; nothing is ever unpickled."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from pe_runtime.contract.errors import CheckpointError

FORMAT = 1
KEY = "playable_environment"


def save_checkpoint(
    path: str | Path, tensors: Mapping[str, Tensor], header: dict[str, Any]
) -> None:
    """Write a checkpoint atomically: a killed process leaves the old file or the new one.

    Args:
        path: Where to; parent folders are made.
        tensors: Weights by name.
        header: JSON-able facts (configuration, action names, steps per second, ...).
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    metadata = {KEY: json.dumps({"format": FORMAT, **header}, sort_keys=True)}
    data = save({n: t.detach().cpu().contiguous() for n, t in tensors.items()}, metadata)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    with part.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    part.replace(path)


def load_checkpoint(
    path: str | Path, device: str = "cpu"
) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """Read a checkpoint.

    Returns:
        Header and weights by name.

    Raises:
        CheckpointError: No such file, truncated, not ours, or of a newer format.
    """
    path = Path(path)
    if not path.is_file():
        raise CheckpointError(f"no checkpoint at {path}")
    try:
        with safe_open(path, framework="pt", device=device) as file:
            metadata = (file.metadata() or {}).get(KEY)
            if metadata is None:
                raise CheckpointError(
                    f"{path} is a safetensors file, but not a checkpoint of this project: it has "
                    f"no {KEY!r} header"
                )
            header = json.loads(metadata)
            if not isinstance(header, dict):
                raise CheckpointError(f"{path}: its header is no JSON object; train it again")
            tensors = {name: file.get_tensor(name) for name in file.keys()}
    except (SafetensorError, OSError, ValueError) as problem:
        raise CheckpointError(
            f"{path} is damaged or no safetensors file ({problem}); copy or train it again"
        ) from problem
    if header.get("format") != FORMAT:
        raise CheckpointError(
            f"{path} has format {header.get('format')!r}; this version reads format {FORMAT}. "
            "Install the version of playable-environments that wrote it, or train again."
        )
    return header, tensors


def read_tensors(path: str | Path) -> dict[str, Tensor]:
    """Tensors by name of a safetensors file of any origin, which needs no header.

    Raises:
        CheckpointError: No such file, or it is damaged.
    """
    try:
        with safe_open(Path(path), framework="pt", device="cpu") as file:
            return {name: file.get_tensor(name) for name in file.keys()}
    except (SafetensorError, OSError, ValueError) as problem:
        raise CheckpointError(f"{path} is missing or no safetensors file ({problem})") from problem


def fit(module_tensors: Mapping[str, Tensor], tensors: Mapping[str, Tensor], what: str) -> None:
    """Check that stored weights fit a module; all misfits are named at once.

    Raises:
        CheckpointError: Weights are missing, unexpected or of another shape.
    """
    missing = [name for name in module_tensors if name not in tensors]
    unexpected = [name for name in tensors if name not in module_tensors]
    misshapen = [
        f"{name} {tuple(tensors[name].shape)} instead of {tuple(module_tensors[name].shape)}"
        for name in module_tensors
        if name in tensors and tensors[name].shape != module_tensors[name].shape
    ]
    found = (("missing", missing), ("unexpected", unexpected), ("misshapen", misshapen))
    problems = [f"{kind}: {', '.join(names)}" for kind, names in found if names]
    if problems:
        raise CheckpointError(f"{what} does not fit its configuration; " + "; ".join(problems))
