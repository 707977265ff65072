"""Rows of the paper's tables: each model measured by the same rules on the same sequences."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pe_runtime.contract.episode import Episode, read_dataset, read_episode
from pe_runtime.contract.errors import EpisodeError
from pe_runtime.evaluation.confidence import Figure, bootstrap
from pe_runtime.evaluation.instruments import Instruments
from pe_runtime.evaluation.long_play import long_play
from pe_runtime.evaluation.paper_figures import COLUMNS, distance_by_step, picture_figures
from pe_runtime.evaluation.playback import Shown, prepare, scheduled, show
from pe_runtime.evaluation.protocol import OF_INFERRED, check_fit, over_players
from pe_runtime.evaluation.sequence import Measured, tracks_of
from pe_runtime.evaluation.subject import Evaluated, acts

LONG_PLAY_TABLE = "long-play"
TABLES = {
    "reconstruction": "reconstruction",
    "playability": "playability",
    "camera": "camera",
    "ablation-synthesis": "reconstruction",
    "ablation-actions": "playability",
    LONG_PLAY_TABLE: LONG_PLAY_TABLE,
}
"""Each table and the protocol that its figures come from."""

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Contender:
    """A row.

    Attributes:
        name: Of the row.
        load: Makes the model; called when its turn comes, so that one is in memory at a time.
    """

    name: str
    load: Callable[[], Evaluated]


def measure_rows(
    contenders: Iterable[Contender],
    data: str | Path,
    table: str,
    instruments: Instruments,
    limit: int | None = None,
    progress: Progress | None = None,
) -> dict[str, dict[str, Any]]:
    """Measure models for one table.

    Args:
        contenders: The rows, in order.
        data: Recorded, held-out sequences.
        table: One of `TABLES`.
        instruments: What is measured with.
        limit: Use the first so many sequences only.
        progress: Called with (sequences done, sequences in all) of each model.

    Returns:
        By row: `figures` (name -> value, low, high, sequences, unit), `sequences`, `note`, and for
        protocols that draw, `add_by_step` in percent of the width.

    Raises:
        EpisodeError: There is no complete episode, none of use, or it shows unknown players.
        ConfigError: A model cannot do what the table asks.
    """
    info, folders = read_dataset(data)
    folders, mode = folders[:limit], TABLES[table]
    rows = {}
    for contender in contenders:
        model = contender.load()
        check_fit(model, info, folders, str(data))
        episodes = (read_episode(folder) for folder in folders)
        if mode == LONG_PLAY_TABLE:
            figures = long_play(model, episodes, progress)
            rows[contender.name] = _row(figures, len(folders))
        else:
            rows[contender.name] = _measured_row(model, episodes, mode, instruments, progress)
    return rows


def _measured_row(
    model: Evaluated,
    episodes: Iterable[Episode],
    mode: str,
    instruments: Instruments,
    progress: Progress | None,
) -> dict[str, Any]:
    shown: list[Shown] = []
    moving: list[Measured] = []
    episodes = list(episodes)
    for number, episode in enumerate(episodes):
        prepared = prepare(model, episode)
        schedule = scheduled(mode, model, episode, prepared)
        if schedule is not None:
            shown.append(show(model, episode, *schedule, instruments))
        if prepared.played:
            tracks = tracks_of(episode, prepared.states, prepared.inferred, prepared.played)
            moving.append(Measured(number, {}, 0, tracks))
        if progress is not None:
            progress(number + 1, len(episodes))
    if not shown:
        needs = "a second view" if mode == "camera" else "players who stay in view"
        raise EpisodeError(f"no sequence serves the protocol {mode!r}: it needs {needs}")
    figures = picture_figures(shown)
    if mode == "playability":
        figures |= _action_figures(moving)
    if mode == "reconstruction":
        # Every frame is shown from its own state, so the last one is like any other.
        figures.pop("add_of_width_last", None)
    own = mode == "camera" and not acts(model)
    note = "no actions: every frame's own state" if own else ""
    return _row(figures, len(shown), note) | {"add_by_step": distance_by_step(shown)}


def _action_figures(moving: Sequence[Measured]) -> dict[str, Figure]:
    wanted = ("delta_mse", "delta_accuracy")
    return {key: bootstrap(moving, over_players(OF_INFERRED[key])) for key in wanted}


def _row(figures: dict[str, Figure], sequences: int, note: str = "") -> dict[str, Any]:
    told = {
        key: asdict(each) | {"unit": COLUMNS[key].unit if key in COLUMNS else ""}
        for key, each in figures.items()
    }
    return {"figures": told, "sequences": sequences, "note": note}
