"""Recorded episodes as tensors in memory, ready to be sampled for training."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Int, UInt8
from torch import Tensor

from pe_runtime.contract.episode import Episode, read_dataset, read_episode
from pe_runtime.contract.errors import EpisodeError
from pe_runtime.geometry.cameras import Cameras
from pe_runtime.images import read_image


@dataclass(frozen=True)
class Clips:
    """All sequences of a data set through one of its cameras.

    Attributes:
        images: 8-bit sRGB pictures.
        intrinsics: Pixels; float64.
        world_from_camera: Camera poses, metres; float64.
        boxes: (left, top, right, bottom), pixels; NaN where an object was not found.
        positions: True ground positions in metres, for evaluation only.
        actions: True actions between frames, for evaluation only; -1 where unknown.
        players: Names of the playable objects.
        action_names: Names of the true actions, where a recorder knows them.
    """

    images: UInt8[Tensor, "clips time height width 3"]
    intrinsics: Float[Tensor, "clips time 3 3"]
    world_from_camera: Float[Tensor, "clips time 4 4"]
    boxes: Float[Tensor, "clips time players 4"]
    positions: Float[Tensor, "clips time players 3"]
    actions: Int[Tensor, "clips steps players"]
    players: tuple[str, ...]
    action_names: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Number of clips."""
        return self.images.shape[0]

    def batch(self, clip: Int[Tensor, " frames"], time: Int[Tensor, " frames"]) -> "FrameBatch":
        """Pick frames, converting pictures to float32 channels-first in [0, 1]."""
        height, width = self.images.shape[2:4]
        return FrameBatch(
            self.images[clip, time].permute(0, 3, 1, 2).float() / 255,
            Cameras(width, height, self.intrinsics[clip, time], self.world_from_camera[clip, time]),
            self.boxes[clip, time],
        )


@dataclass(frozen=True)
class FrameBatch:
    """Frames with their cameras and boxes, as the encoder takes them."""

    images: Float[Tensor, "frames 3 height width"]
    cameras: Cameras
    boxes: Float[Tensor, "frames players 4"]

    def to(self, device: torch.device | str) -> "FrameBatch":
        """The batch on another device."""
        cameras = Cameras(
            self.cameras.width,
            self.cameras.height,
            self.cameras.intrinsics.to(device),
            self.cameras.world_from_camera.to(device),
        )
        return FrameBatch(self.images.to(device), cameras, self.boxes.to(device))


def load_clips(root: str | Path, view: int = 0, limit: int | None = None) -> Clips:
    """Read a data set into memory; 250 clips of 12 frames at 256x144 take 330 MB.

    Args:
        root: Folder with dataset.json.
        view: Which of the recorded cameras.
        limit: Only so many sequences, from the first.

    Raises:
        EpisodeError: No sequences, a damaged one, or sequences that do not fit together.
    """
    info, paths = read_dataset(root)
    episodes = [read_episode(path) for path in paths[:limit]]
    if not episodes:
        raise EpisodeError(
            f"{root} holds no complete sequence; record some with `pe dataset record`"
        )
    if view >= info.views:
        raise EpisodeError(f"{root} has {info.views} camera(s); view {view} was asked for")
    try:
        images = np.stack([_frames(e, view) for e in episodes])
        arrays = [e.arrays for e in episodes]
        stacked = {
            "intrinsics": np.stack([a.intrinsics[view] for a in arrays]),
            "world_from_camera": np.stack([a.world_from_camera[view] for a in arrays]),
            "boxes": np.stack([a.boxes[view] for a in arrays]),
            "positions": np.stack([a.positions for a in arrays]).astype(np.float32),
            "actions": np.stack([a.actions for a in arrays]).astype(np.int64),
        }
    except ValueError as problem:
        raise EpisodeError(
            f"the sequences of {root} differ in length or size: {problem}"
        ) from problem
    tensors = {name: torch.from_numpy(each) for name, each in stacked.items()}
    return Clips(
        torch.from_numpy(images), **tensors, players=info.objects, action_names=info.actions
    )


def _frames(episode: Episode, view: int) -> np.ndarray:
    paths = [episode.frame_path(view, frame) for frame in range(episode.arrays.frames)]
    return np.stack([np.floor(read_image(path) * 255 + 0.5).astype(np.uint8) for path in paths])
