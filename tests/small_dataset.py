"""A small data set on disk with cameras, boxes, and real pictures."""

import numpy as np

from pe_runtime.contract.episode import (
    DatasetInfo,
    EpisodeArrays,
    episode_path,
    frame_path,
    mask_path,
    write_dataset,
    write_depth,
    write_episode,
)
from pe_runtime.images import write_png

WIDTH, HEIGHT, FRAMES = 64, 36, 12
PLAYERS, ACTIONS = ("far", "near"), ("idle", "left", "swing")


def arrays(views=1, frames=FRAMES, seed=0):
    """Two players, the first 10 and the second 20 pixels high; frame 0 lacks the first."""
    rng = np.random.default_rng(seed)
    turn = np.eye(4)
    turn[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    turn[:3, 3] = [0, -8, 2]
    left, top = rng.uniform(5, 20, (views, frames, 2)), rng.uniform(2, 12, (views, frames, 2))
    heights = np.broadcast_to([10.0, 20.0], left.shape)
    boxes = np.stack([left, top, left + 8, top + heights], axis=-1).astype(np.float32)
    boxes[:, 0, 0] = np.nan
    return EpisodeArrays(
        intrinsics=np.tile([[70.0, 0, 32], [0, 70, 18], [0, 0, 1]], (views, frames, 1, 1)),
        world_from_camera=np.tile(turn, (views, frames, 1, 1)),
        boxes=boxes,
        present=np.isfinite(boxes).all(-1),
        positions=rng.normal(size=(frames, 2, 3)),
        actions=np.tile(np.array([[0, 2]], np.int8), (frames - 1, 1)),
    )


def write_small(root, episodes=2, views=1, seed=7):
    info = DatasetInfo("court", seed, episodes, 5.0, WIDTH, HEIGHT, PLAYERS, ACTIONS, views)
    write_dataset(root, info)
    rng = np.random.default_rng(seed)
    for number in range(episodes):
        path = episode_path(root, number)
        for view, frame in np.ndindex(views, FRAMES):
            for place in (frame_path, mask_path):
                place(path, view, frame).parent.mkdir(parents=True, exist_ok=True)
            pixels = rng.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
            write_png(frame_path(path, view, frame), pixels)
            write_png(mask_path(path, view, frame), pixels[..., 0] // 86)
            write_depth(path, view, frame, np.ones((HEIGHT, WIDTH)))
        write_episode(path, info, arrays(views, seed=number), {"sequence": number})
    return root
