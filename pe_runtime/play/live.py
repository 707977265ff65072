"""Playing live: a session whose moments are drawn to disk, take by take. No terminal in here."""

import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pe_runtime.play.commands import Command
from pe_runtime.play.session import Session, begin, obey
from pe_runtime.play.stage import Stage
from pe_runtime.play.takes import (
    draw_now,
    drop_later_frames,
    finished_frames,
    frames_per_step,
    shot_of_session,
    write_shot,
)
from pe_runtime.shots.files import frame_path, render_shot
from pe_runtime.shots.frames import OnProgress, model_digest
from pe_runtime.shots.rollout import World
from pe_runtime.shots.video import write_video


@dataclass(frozen=True)
class SavedTake:
    """What is on disk of a take.

    Attributes:
        folder: Holds the frames.
        shot: The document that repeats it.
        frames: Numbers of the frames that are drawn.
        video: The film, if one was asked for.
        paths: Player -> position at every step, world, metres.
    """

    folder: Path
    shot: Path
    frames: tuple[int, ...]
    video: Path | None
    paths: dict[str, list[list[float]]]

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "folder": str(self.folder),
            "shot": str(self.shot),
            "frames": list(self.frames),
            "video": None if self.video is None else str(self.video),
            "paths": self.paths,
        }


class LivePlay:
    """A session with its files: `OUT/take_1/0001.png` and so on, `shot.json`, `play.mp4`.

    Args:
        world: The loaded environment.
        stage: What is played.
        out: Folder of the takes; those of earlier sessions stay.

    Raises:
        ShotError: The frame rate does not suit live play.
    """

    def __init__(self, world: World, stage: Stage, out: Path) -> None:
        frames_per_step(stage)
        self._world = world
        self._out = out
        self._model = model_digest(world)
        self.session: Session = begin(stage)
        self.folder = _new_folder(out)

    def do(self, command: Command) -> None:
        """Obey a command; a new take goes into a folder of its own."""
        self.session = obey(self._world, self.session, command)
        if command.verb == "new":
            self.folder = _new_folder(self._out)

    def draw(self) -> tuple[Path, np.ndarray]:
        """Draw the latest moment: its file, and its (height, width, 3) picture in [0, 1]."""
        drawn = draw_now(self._world, self.session, self.folder, self._model)
        drop_later_frames(self.folder, shot_of_session(self.session))
        return drawn

    def save(self, mp4: bool = False, on_progress: OnProgress | None = None) -> SavedTake:
        """Write the shot of the take, draw what is missing of its frames, and join them if asked.

        Args:
            mp4: Also write the film.
            on_progress: Called with the frames done and their number.
        """
        shot = shot_of_session(self.session)
        written = write_shot(shot, self.folder)
        drop_later_frames(self.folder, shot)
        render_shot(self._world, shot, self.folder, on_progress=on_progress)
        if on_progress is not None:
            on_progress(len(shot.frames), len(shot.frames))
        video = self.folder / "play.mp4" if mp4 else None
        if video is not None:
            write_video([frame_path(self.folder, each) for each in shot.frames], shot.fps, video)
        return SavedTake(self.folder, written, tuple(shot.frames), video, self._paths())

    def abandon(self) -> SavedTake:
        """Write the shot of the take and leave its frames as they are."""
        shot = shot_of_session(self.session)
        written = write_shot(shot, self.folder)
        frames = finished_frames(self._world, shot, self.folder)
        return SavedTake(self.folder, written, frames, None, self._paths())

    def _paths(self) -> dict[str, list[list[float]]]:
        return {
            name: [each.state[name].position.tolist() for each in self.session.moments]
            for name in self.session.stage.players
        }


def _new_folder(out: Path) -> Path:
    """The first `take_N` that is not there yet."""
    numbered = (out / f"take_{number}" for number in itertools.count(1))
    return next(folder for folder in numbered if not folder.exists())
