"""What a data set holds, in numbers."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pe_runtime.contract.episode import DatasetInfo, Episode, read_dataset, read_episode


@dataclass(frozen=True)
class PlayerFacts:
    """One playable object over a whole data set.

    Attributes:
        present: Share of the pictures in which it has a box.
        heights: Smallest, median and largest height of its boxes in pixels; empty if it has none.
        actions: Share of each known action; empty if none is known.
    """

    present: float
    heights: tuple[float, ...]
    actions: dict[str, float]


@dataclass(frozen=True)
class DatasetFacts:
    """A data set: what it says of itself, and what was counted.

    Attributes:
        info: What all episodes share.
        episodes: Complete episodes.
        pictures: Pictures of all views.
        bytes: Size on disk of all files.
        noise: The noise of a disturbed data set; empty if it is none.
        players: By name.
    """

    info: DatasetInfo
    episodes: int
    pictures: int
    bytes: int
    noise: dict[str, float]
    players: dict[str, PlayerFacts]

    def as_dict(self) -> dict:
        """Plain values, ready for JSON."""
        info = self.info
        return {
            "scene": info.scene,
            "seed": info.seed,
            "complete_episodes": self.episodes,
            "episodes": info.count,
            "frames": self.pictures,
            "size": f"{info.width}x{info.height}",
            "views": info.views,
            "bytes": self.bytes,
            "steps_per_second": info.steps_per_second,
            "objects": list(info.objects),
            "actions": list(info.actions),
            "noise": self.noise,
            "players": {
                name: {
                    "present": each.present,
                    "heights": list(each.heights),
                    "actions": each.actions,
                }
                for name, each in self.players.items()
            },
        }


def read_facts(root: str | Path) -> DatasetFacts:
    """Count what a data set holds.

    Raises:
        EpisodeError: If it is none, or an episode is damaged.
    """
    info, folders = read_dataset(root)
    episodes = [read_episode(folder) for folder in folders]
    return DatasetFacts(
        info=info,
        episodes=len(episodes),
        pictures=sum(e.arrays.frames * e.arrays.views for e in episodes),
        bytes=sum(path.stat().st_size for path in Path(root).rglob("*") if path.is_file()),
        noise=dict(episodes[0].metadata.get("noise", {})) if episodes else {},
        players={name: _player_facts(info, episodes, k) for k, name in enumerate(info.objects)},
    )


def _player_facts(info: DatasetInfo, episodes: Sequence[Episode], player: int) -> PlayerFacts:
    if not episodes:
        return PlayerFacts(0.0, (), {})
    boxes = np.concatenate([e.arrays.boxes[:, :, player].reshape(-1, 4) for e in episodes])
    present = np.concatenate([e.arrays.present[:, :, player].ravel() for e in episodes])
    actions = np.concatenate([e.arrays.actions[:, player] for e in episodes])
    heights = (boxes[:, 3] - boxes[:, 1])[present]
    known = actions[actions >= 0]
    shares = np.bincount(known, minlength=len(info.actions)) / max(len(known), 1)
    named = dict(zip(info.actions, shares.tolist(), strict=False)) if len(known) else {}
    return PlayerFacts(
        present=float(present.mean()) if len(present) else 0.0,
        heights=tuple(np.percentile(heights, [0, 50, 100]).tolist()) if len(heights) else (),
        actions=named,
    )
