"""The two worlds of the release, and how its data sets are told apart: by where the cameras' up is.

A data set does not say which world it shows. Tennis has z up, Minecraft y; a camera that films
players stands above their ground and does not hang upside down, so that only one axis can be up.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import torch

from pe_runtime.contract.errors import EpisodeError
from pe_runtime.geometry.native_world import rotation_from_euler

AXES = {"x": 0, "y": 1, "z": 2}
CLEAR, MARGIN = 0.2, 2.0
"""An axis is up if it has at least this score, and so many times the other's."""


@dataclass(frozen=True)
class World:
    """What the release presumes about a data set.

    Attributes:
        name: How it is called.
        up: Up axis, "z" or "y".
        frames_per_second: Of the stored pictures.
    """

    name: str
    up: str
    frames_per_second: float


WORLDS = MappingProxyType(
    {
        "tennis": World("tennis", "z", 5.0),
        # Every fifth picture makes the 5 steps a second that are played.
        "minecraft": World("minecraft", "y", 25.0),
    }
)


def world_seen(angles: np.ndarray, translations: np.ndarray) -> str | None:
    """Name of the world that cameras (frames, 3) belong to; None if they leave it open."""
    upward = rotation_from_euler(torch.from_numpy(angles))[..., 1].numpy()
    scores = {
        world.name: _score(upward[:, AXES[world.up]], translations[:, AXES[world.up]])
        for world in WORLDS.values()
    }
    other, best = sorted(scores, key=lambda name: scores[name])
    clear = scores[best] >= max(CLEAR, MARGIN * scores[other])
    return best if clear else None


def _score(upward: np.ndarray, height: np.ndarray) -> float:
    """How far pictures stand upright along an axis, counting cameras above the ground alone."""
    return float(np.mean(np.where(height > 0, np.maximum(upward, 0), 0)))


def choose_world(seen: Mapping[str, str | None], wanted: str | None) -> tuple[World, str]:
    """The world of a data set, and what told it: "cameras" or "--world".

    Args:
        seen: What the cameras of each sequence say.
        wanted: What the user says.

    Raises:
        EpisodeError: The cameras contradict each other or the user, or leave it open.
    """
    if wanted is not None and wanted not in WORLDS:
        raise EpisodeError(f"world {wanted!r} is unknown; expected {' or '.join(WORLDS)}")
    examples = {name: sequence for sequence, name in seen.items() if name is not None}
    if wanted is None and len(examples) > 1:
        told = ", ".join(f"{where} are {name}'s" for name, where in sorted(examples.items()))
        raise EpisodeError(
            f"cameras contradict each other: those of {told}; give --world, and the sequences of "
            "the other are left out"
        )
    if wanted is None and not examples:
        raise EpisodeError("the cameras do not tell which axis is up; give --world")
    if wanted is not None and examples and wanted not in examples:
        ((name, where),) = examples.items()
        raise EpisodeError(
            f"this is no data set of {wanted}: cameras such as those of {where} have "
            f"{WORLDS[name].up} up, as in {name}; give --world {name}, or none"
        )
    if wanted is not None:
        return WORLDS[wanted], "--world"
    return WORLDS[next(iter(examples))], "cameras"
