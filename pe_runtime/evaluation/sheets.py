"""Sample sheets: pictures by which a stranger can judge what the figures say.

poses.png        recorded | drawn | drawn with another frame's pose | with another sequence's
styles.png       recorded | drawn | drawn with another sequence's colours | that sequence
playability.png  recorded frames over the frames that the first one and its actions gave
camera.png       the second camera's frames over those drawn from the first state
long-play.png    an action held for 200 steps
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from pe_runtime.contract.episode import Episode
from pe_runtime.environment import RenderOptions
from pe_runtime.evaluation.exchange import with_styles
from pe_runtime.evaluation.long_play import LONG_PLAY, action_count, walking_actions
from pe_runtime.evaluation.playback import prepare, scheduled
from pe_runtime.evaluation.poses import other_frame, with_poses
from pe_runtime.evaluation.rules import RULES
from pe_runtime.evaluation.subject import (
    RECORDED_VIEW,
    Evaluated,
    acts,
    boxes_of,
    can_be_followed,
    encoded,
    picture_of,
    roll_out,
)
from pe_runtime.images import to_uint8, write_png
from pe_runtime.state import EnvironmentState, move

COLUMNS = 6
MARGIN, LABEL = 4, 16
INK, PAPER = 30, 245
CLOSE = 192
"""Pixel rows of a close-up of a player."""


@dataclass
class Sheet:
    """Labelled rows of pictures of equal size."""

    rows: list[tuple[str, list[np.ndarray]]] = field(default_factory=list)

    def add(self, label: str, pictures: Sequence[np.ndarray]) -> None:
        """Add a row."""
        self.rows.append((label, [to_uint8(np.clip(each, 0, 1)) for each in pictures]))

    def write(self, path: str | Path) -> Path:
        """Lay the rows out below each other and write a PNG."""
        height, width = self.rows[0][1][0].shape[:2]
        columns = max(len(pictures) for _, pictures in self.rows)
        pitch = height + LABEL + MARGIN
        shape = (len(self.rows) * pitch + MARGIN, columns * (width + MARGIN) + MARGIN, 3)
        sheet = np.full(shape, PAPER, np.uint8)
        for row, (label, pictures) in enumerate(self.rows):
            top = row * pitch + MARGIN
            place = (MARGIN, top + LABEL - 5)
            font = cv2.FONT_HERSHEY_SIMPLEX
            cv2.putText(sheet, label, place, font, 0.38, (INK,) * 3, 1, cv2.LINE_AA)
            for column, picture in enumerate(pictures):
                left = column * (width + MARGIN) + MARGIN
                sheet[top + LABEL : top + LABEL + height, left : left + width] = picture
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        write_png(path, sheet)
        return Path(path)


def write_sheets(environment: Evaluated, episodes: Sequence[Episode], folder: Path) -> list[Path]:
    """Write all sheets that the model and the data allow.

    Args:
        environment: The model.
        episodes: Recorded sequences; the first few are shown, the next lends its codes.
        folder: Where to.
    """
    made = []
    if environment.playable_names:
        made.append(pose_sheet(environment, episodes).write(folder / "poses.png"))
        made.append(style_sheet(environment, episodes).write(folder / "styles.png"))
    for mode in ("playability", "camera") if acts(environment) else ("camera",):
        sheet = playback_sheet(environment, episodes, mode)
        if sheet.rows:
            made.append(sheet.write(folder / f"{mode}.png"))
    usable = [episode for episode in episodes if can_be_followed(environment, episode)]
    if usable:
        made.append(long_play_sheet(environment, usable[0]).write(folder / "long-play.png"))
    return made


def pose_sheet(environment: Evaluated, episodes: Sequence[Episode]) -> Sheet:
    """Close-ups of the first player, over time; two sequences."""
    sheet = Sheet()
    for index, episode in enumerate(episodes[:2]):
        name = environment.playable_names[0]
        lender = episodes[(index + 1) % len(episodes)]
        frames = _frames(episode)
        states = [encoded(environment, episode, t) for t in range(episode.arrays.frames)]
        lent = [encoded(environment, lender, min(t, lender.arrays.frames - 1)) for t in frames]
        far = [states[other_frame(t, len(states))] for t in frames]
        versions = {
            "drawn": [states[t] for t in frames],
            "drawn with the pose of another frame": [
                with_poses(states[t], each, [name]) for t, each in zip(frames, far, strict=True)
            ],
            "drawn with the pose of another sequence": [
                with_poses(states[t], each, [name]) for t, each in zip(frames, lent, strict=True)
            ],
        }
        recorded = [_close(picture_of(episode, 0, t), episode, t, name) for t in frames]
        sheet.add(f"recorded, {name}", recorded)
        for label, wanted in versions.items():
            drawn = [
                _drawn(environment, s, episode, t) for s, t in zip(wanted, frames, strict=True)
            ]
            close = [_close(p, episode, t, name) for p, t in zip(drawn, frames, strict=True)]
            sheet.add(label, close)
    return sheet


def style_sheet(environment: Evaluated, episodes: Sequence[Episode]) -> Sheet:
    """Whole frames of several sequences with the players' and with everything's other style."""
    rows: dict[str, list[np.ndarray]] = {}
    for index, episode in enumerate(episodes[:COLUMNS]):
        lender = episodes[(index + 1) % len(episodes)]
        own, lent = encoded(environment, episode, 0), encoded(environment, lender, 0)
        players = [n for n in environment.playable_names if lent[n].visible and own[n].visible]
        versions = {
            "drawn": own,
            "drawn with the players' style of the next": with_styles(own, lent, players),
            "drawn with all styles of the next": with_styles(own, lent, [*lent.objects]),
        }
        rows.setdefault("recorded", []).append(picture_of(episode, 0, 0))
        for label, state in versions.items():
            rows.setdefault(label, []).append(_drawn(environment, state, episode, 0))
        rows.setdefault("the next, recorded", []).append(picture_of(lender, 0, 0))
    sheet = Sheet()
    for label, pictures in rows.items():
        sheet.add(label, pictures)
    return sheet


def playback_sheet(environment: Evaluated, episodes: Sequence[Episode], mode: str) -> Sheet:
    """Recorded frames over those that a protocol draws; three sequences."""
    sheet = Sheet()
    for episode in episodes[:3]:
        schedule = scheduled(mode, environment, episode, prepare(environment, episode))
        if schedule is None:
            continue
        states, view = schedule
        frames = _frames(episode)
        sheet.add(f"recorded, view {view}", [picture_of(episode, view, t) for t in frames])
        drawn = [_drawn(environment, states[t], episode, t, view) for t in frames]
        sheet.add(f"{mode}: drawn", drawn)
    return sheet


def long_play_sheet(environment: Evaluated, episode: Episode) -> Sheet:
    """Each action held for a long time; close-ups of the first player where it started."""
    sheet, start = Sheet(), encoded(environment, episode, 0)
    names, camera = environment.playable_names, episode.camera(RECORDED_VIEW, 0)
    steps = LONG_PLAY.steps
    shown = [*range(5), *range(steps - 4, steps + 1)]
    walking = walking_actions(environment, episode)
    for action in [*walking, *(a for a in range(action_count(environment)) if a not in walking)]:
        held = dict.fromkeys(names, np.full(steps, action))
        states = roll_out(environment, start, held, [camera] * (steps + 1))
        # Who has walked out of view is shown at home: what is judged is the pose.
        home = [_brought_home(states[t], start, names) for t in shown]
        drawn = [_drawn(environment, each, episode, 0) for each in home]
        label = (
            f"{environment.action_names[names[0]][action]}, held; steps 0-4, {steps - 4}-{steps}"
        )
        sheet.add(label, [_close(picture, episode, 0, names[0]) for picture in drawn])
    return sheet


def _brought_home(
    state: EnvironmentState, start: EnvironmentState, names: Sequence[str]
) -> EnvironmentState:
    for name in names:
        state = move(state, name, start[name].position)
    return state


def _frames(episode: Episode) -> list[int]:
    last = episode.arrays.frames - 1
    return sorted({round(share) for share in np.linspace(0, last, COLUMNS)})


def _drawn(
    environment: Evaluated,
    state: EnvironmentState,
    episode: Episode,
    frame: int,
    view: int = RECORDED_VIEW,
) -> np.ndarray:
    options = RenderOptions(RULES.quality)
    return environment.render(state, episode.camera(view, frame), options).rgb


def _close(picture: np.ndarray, episode: Episode, frame: int, name: str) -> np.ndarray:
    """A square around a player, enlarged without smoothing; the whole frame if it is not seen."""
    height, width = picture.shape[:2]
    left, top, right, bottom = boxes_of(episode, frame).get(name, (0, 0, width, height))
    side = min(1.25 * max(right - left, bottom - top), height)
    x = min(max((left + right - side) / 2, 0), width - side)
    y = min(max((top + bottom - side) / 2, 0), height - side)
    rows, columns = (slice(round(at), round(at + side)) for at in (y, x))
    return cv2.resize(picture[rows, columns], (CLOSE, CLOSE), interpolation=cv2.INTER_NEAREST)
