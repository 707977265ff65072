"""The pictures of the fake world: a gradient that moves, and upright blocks on it."""

import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pe_runtime.contract.camera import Camera, project
from pe_runtime.contract.shot import Shot

PLAYER_SIZE = (0.5, 1.8)
"""Width and height of a block, metres."""


@dataclass(frozen=True)
class Block:
    """One player: its foot (3,), metres, and its heading, radians."""

    place: np.ndarray
    heading: float = 0.0

    @property
    def blue(self) -> int:
        """The channel that tells the heading."""
        return round(60 + 40 * math.sin(self.heading))


def draw(
    shot: Shot, frame: int, blocks: Mapping[str, Block], players: Sequence[str]
) -> dict[str, np.ndarray]:
    """The buffers of one frame, as the worker sends them.

    Args:
        shot: Decides the gradient and the passes.
        frame: Scene frame.
        blocks: The players that are seen.
        players: All players; the order decides their colours.
    """
    camera = shot.camera_at(frame)
    rows, columns = np.mgrid[: camera.height, : camera.width]
    seed = zlib.crc32(shot.model.encode()) % 97
    drift = camera.world_from_camera[:2, 3] * 16.0
    rgb = np.stack(
        [columns + drift[0] + frame, rows + drift[1] + seed, columns + rows + 2 * frame], axis=-1
    )
    buffers = {"rgb": (np.floor(rgb) % 256).astype(np.uint8)}
    depth = np.full((camera.height, camera.width), np.inf, np.float32)
    masks = {name: np.zeros_like(depth) for name in (*players, *shot.mask_names)}
    far_first = sorted(blocks, key=lambda name: -project(camera, blocks[name].place[None])[1][0])
    for name in far_first:
        inside, distance = _covered(camera, blocks[name].place, rows, columns)
        buffers["rgb"][inside] = (230, 40 + 150 * players.index(name), blocks[name].blue)
        depth[inside] = distance
        for other in masks:
            masks[other][inside] = other == name
    if shot.wants_depth:
        buffers["depth"] = depth
    return buffers | {f"mask:{name}": masks[name] for name in shot.mask_names}


def _covered(
    camera: Camera, place: np.ndarray, rows: np.ndarray, columns: np.ndarray
) -> tuple[np.ndarray, float]:
    """Pixels of an upright block at a place, and its planar depth in metres."""
    ends, depths = project(camera, np.stack([place, place + [0.0, 0.0, PLAYER_SIZE[1]]]))
    if not (depths > 0).all():
        return np.zeros(rows.shape, bool), math.inf
    half = camera.intrinsics[0, 0] * PLAYER_SIZE[0] / 2 / depths[0]
    across = np.abs(columns + 0.5 - ends[0, 0]) < half
    along = (rows + 0.5 < ends[0, 1]) & (rows + 0.5 > ends[1, 1])
    return across & along, float(depths[0])
