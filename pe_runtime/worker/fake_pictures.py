"""The pictures of the fake world: a gradient that moves, and upright blocks on it."""

import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pe_runtime.contract.camera import Camera, project
from pe_runtime.contract.shot import LAYER_PASS_PREFIX, MASK_PASS_PREFIX, Shot

PLAYER_SIZE = (0.5, 1.8)
"""Width and height of a block, metres."""


@dataclass(frozen=True)
class Block:
    """One player.

    Attributes:
        place: Its foot (3,), metres.
        heading: Radians.
        green: The channel that tells its style.
        held: The frame whose pose it holds; None where its pose is free.
    """

    place: np.ndarray
    heading: float
    green: float
    held: int | None = None

    @property
    def colour(self) -> tuple[int, int, int]:
        """Red tells the pose, green the style, blue the heading."""
        red = 230 if self.held is None else 120 + self.held % 100
        return red, round(self.green), self.blue

    @property
    def blue(self) -> int:
        """The channel that tells the heading."""
        return round(60 + 40 * math.sin(self.heading))


def draw(
    shot: Shot, frame: int, blocks: Mapping[str, Block], players: Sequence[str]
) -> dict[str, np.ndarray]:
    """The buffers of one frame, as the worker sends them.

    Args:
        shot: Decides the gradient, the passes and the region.
        frame: Scene frame.
        blocks: The players that are seen.
        players: All players, seen or not.
    """
    camera = shot.camera_at(frame)
    rows, columns = np.mgrid[: camera.height, : camera.width]
    seed = zlib.crc32(shot.model.encode()) % 97
    drift = camera.world_from_camera[:2, 3] * 16.0
    rgb = np.stack(
        [columns + drift[0] + frame, rows + drift[1] + seed, columns + rows + 2 * frame], axis=-1
    )
    background = (np.floor(rgb) % 256).astype(np.uint8)
    buffers = {"rgb": background.copy()}
    depth = np.full((camera.height, camera.width), np.inf, np.float32)
    masks = {name: np.zeros_like(depth) for name in (*players, *shot.mask_names)}
    layers = {
        name: np.dstack([background, np.zeros_like(background[..., :1])])
        for name in shot.layer_names
    }
    far_first = sorted(blocks, key=lambda name: -project(camera, blocks[name].place[None])[1][0])
    for name in far_first:
        inside, distance = _covered(camera, blocks[name].place, rows, columns)
        buffers["rgb"][inside] = blocks[name].colour
        if name in layers:
            layers[name][inside] = *blocks[name].colour, 255
        depth[inside] = distance
        for other in masks:
            masks[other][inside] = other == name
    if shot.wants_depth:
        buffers["depth"] = depth
    if shot.wants_background:
        buffers["background"] = background
    buffers |= {f"{MASK_PASS_PREFIX}{name}": masks[name] for name in shot.mask_names}
    buffers |= {f"{LAYER_PASS_PREFIX}{name}": layer for name, layer in layers.items()}
    left, top, width, height = shot.region or (0, 0, camera.width, camera.height)
    rows, columns = slice(top, top + height), slice(left, left + width)
    return {name: buffer[rows, columns] for name, buffer in buffers.items()}


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
