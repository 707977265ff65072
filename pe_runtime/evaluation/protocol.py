"""The evaluation of a model on recorded, held-out sequences: one dictionary of figures."""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pe_runtime.contract.episode import DatasetInfo, read_dataset, read_episode
from pe_runtime.contract.errors import EpisodeError
from pe_runtime.evaluation.confidence import Figure, bootstrap, bootstrap_mean
from pe_runtime.evaluation.exchange import Donor, Silhouette
from pe_runtime.evaluation.motion import (
    delta_accuracy,
    delta_mse,
    normalised_mutual_information,
    standing_accuracy,
    with_standing_merged,
)
from pe_runtime.evaluation.sequence import Measured, measure
from pe_runtime.evaluation.subject import Evaluated, mean_told
from pe_runtime.evaluation.tables import FIGURES


def evaluate(
    environment: Evaluated,
    dataset_root: str | Path,
    limit: int | None = None,
    every: int = 3,
    progress: Callable[[int, int], None] | None = None,
    silhouette: Silhouette | None = None,
) -> dict[str, Any]:
    """Measure a model on recorded episodes.

    Args:
        environment: The model.
        dataset_root: A recorded data set the model was not trained on.
        limit: Use the first so many sequences only.
        every: Draw each n-th frame of a sequence; motion always uses all frames.
        progress: Called with (sequences done, sequences in all).
        silhouette: Finds the pixels of people in a picture (`PersonDetector.silhouette`).

    Returns:
        `figures`: name -> value, low, high (95 % interval over sequences), sequences, unit, for
        the names of `tables.FIGURES` that could be measured. `error_by_step`: mean position error
        in metres at each step, of the rollout (`rollout`) and of standing still (`static`). And
        `scene`, `sequences`, `moving_sequences` (those behind the motion figures), `frames`.

    Raises:
        EpisodeError: If there is no complete episode, or it shows players the model has not.
    """
    info, folders = read_dataset(dataset_root)
    folders = folders[:limit]
    check_fit(environment, info, folders, str(dataset_root))
    measured = []
    for number, folder in enumerate(folders):
        # The next sequence lends its codes; the last one borrows from the first.
        lender = folders[(number + 1) % len(folders)]
        donor = None
        if lender != folder:
            donor = Donor(environment, read_episode(lender), silhouette)
        measured.append(measure(environment, read_episode(folder), number, every, donor))
        if progress is not None:
            progress(number + 1, len(folders))
    moving = [each for each in measured if each.tracks]
    figures = {**_visual_figures(measured), **_motion_figures(moving)}
    return {
        "scene": info.scene,
        "sequences": len(measured),
        "moving_sequences": len(moving),
        "frames": sum(each.frames for each in measured),
        "figures": {
            key: asdict(figures[key]) | {"unit": unit}
            for key, (_, unit) in FIGURES.items()
            if key in figures
        },
        "error_by_step": _error_by_step(moving),
    }


def check_fit(
    environment: Evaluated, info: DatasetInfo, folders: Sequence[Path], where: str
) -> None:
    """Refuse a data set without episodes, or of players that a model with players lacks.

    Raises:
        EpisodeError: It does not fit.
    """
    if not folders:
        raise EpisodeError(f"{where}: no complete episode to evaluate; finish the recording")
    strangers = sorted(set(info.objects) - set(environment.playable_names))
    # A model without any players can still be judged by its pictures.
    if strangers and environment.playable_names:
        raise EpisodeError(
            f"{where} shows {', '.join(strangers)}; the model's players are "
            f"{', '.join(environment.playable_names)}: take a model of this scene"
        )


def _visual_figures(measured: Sequence[Measured]) -> dict[str, Figure]:
    keys = dict.fromkeys(key for each in measured for key in each.visual)
    return {
        key: bootstrap_mean([each.visual.get(key, math.nan) for each in measured]) for key in keys
    }


def _motion_figures(moving: Sequence[Measured]) -> dict[str, Figure]:
    """Figures of actions (pooled over sequences, averaged over players) and of positions."""
    if not moving:
        return {}
    known = all((track.true >= 0).all() for each in moving for track in each.tracks.values())
    pooled = OF_INFERRED | OF_TRUE if known else OF_INFERRED
    figures = {key: bootstrap(moving, over_players(each)) for key, each in pooled.items()}
    averaged = {
        "encoding_error": lambda track: track.encoded_errors.mean(),
        "rollout_error": lambda track: track.rollout_errors[1:].mean(),
        "rollout_error_last": lambda track: track.rollout_errors[-1],
        "static_error_last": lambda track: track.static_errors[-1],
    }
    for key, error in averaged.items():
        means = [mean_told([error(track) for track in each.tracks.values()]) for each in moving]
        figures[key] = bootstrap_mean(means)
    return figures


@dataclass(frozen=True)
class Pool:
    """One player's steps from several sequences; `sequence` says which step is from which."""

    moves: np.ndarray
    inferred: np.ndarray
    true: np.ndarray
    sequence: np.ndarray


OF_INFERRED: dict[str, Callable[[Pool], float]] = {
    "delta_mse": lambda p: delta_mse(p.moves, p.inferred),
    "delta_accuracy": lambda p: delta_accuracy(p.moves, p.inferred, p.sequence),
    "delta_accuracy_merged": lambda p: delta_accuracy(
        p.moves, with_standing_merged(p.moves, p.inferred), p.sequence
    ),
}
"""Figures of the actions that the model read off the pictures, from one player's pooled steps."""

OF_TRUE: dict[str, Callable[[Pool], float]] = {
    "delta_mse_of_true_actions": lambda p: delta_mse(p.moves, p.true),
    "delta_accuracy_of_true_actions": lambda p: delta_accuracy(p.moves, p.true, p.sequence),
    "delta_accuracy_merged_of_true_actions": lambda p: delta_accuracy(
        p.moves, with_standing_merged(p.moves, p.true), p.sequence
    ),
    "action_agreement": lambda p: normalised_mutual_information(p.inferred, p.true),
    "standing_accuracy": lambda p: standing_accuracy(p.moves, p.inferred, p.true, p.sequence),
}
"""Figures that need the actions which the recorder carried out."""


def over_players(measure: Callable[[Pool], float]) -> Callable[[Sequence[Measured]], float]:
    """Measure each player's pooled steps and average: players may have actions of their own."""

    def meanover_players(sequences: Sequence[Measured]) -> float:
        return mean_told([measure(_pool(sequences, name)) for name in sequences[0].tracks])

    return meanover_players


def _pool(sequences: Sequence[Measured], name: str) -> Pool:
    tracks = [each.tracks[name] for each in sequences]
    numbers = [np.full(len(t.inferred), e.number) for t, e in zip(tracks, sequences, strict=True)]
    columns = ([t.moves for t in tracks], [t.inferred for t in tracks], [t.true for t in tracks])
    return Pool(*(np.concatenate(column) for column in (*columns, numbers)))


def _error_by_step(moving: Sequence[Measured]) -> dict[str, list[float]]:
    """Mean over players and sequences, as far as the shortest sequence goes."""
    tracks = [track for each in moving for track in each.tracks.values()]
    shortest = min((len(track.rollout_errors) for track in tracks), default=0)
    kinds = {"rollout": "rollout_errors", "static": "static_errors"}
    return {
        kind: np.mean([getattr(t, name)[:shortest] for t in tracks], axis=0).tolist()
        if tracks
        else []
        for kind, name in kinds.items()
    }
