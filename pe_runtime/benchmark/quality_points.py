"""Run time, error and memory of every preset and switch: fresh processes, interleaved."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from pe_runtime.benchmark.errors import picture_error, pooled
from pe_runtime.benchmark.jobs import Case, Measurement, Run
from pe_runtime.benchmark.motion import FILMS
from pe_runtime.benchmark.plan import Bench
from pe_runtime.benchmark.points import Point, all_points
from pe_runtime.benchmark.timing import interleaved, spread

STARTING = "moving/0"
"""The first frame, which all films share."""


def measure_points(bench: Bench) -> list[dict[str, Any]]:
    """One record per point; docs/benchmark.md says what its keys mean."""
    points = all_points(switches=bench.plan.switches)
    last = bench.plan.frames - 1
    shown = dict.fromkeys((name, frame) for name in ("moving", "standing") for frame in (0, last))
    truth = {f"{name}/{frame}": bench.truth(name, frame) for name, frame in shown}
    converged = bench.truth("moving", 0, bench.plan.finer)
    found: dict[str, list[Measurement]] = {point.name: [] for point in points}
    for point in interleaved(points, bench.plan.repeats):
        found[point.name].append(bench.run(_films(point, bench.plan.frames)))
    return [_record(point, found[point.name], truth, converged) for point in points]


def _films(point: Point, frames: int) -> tuple[Case, ...]:
    kept = (0, frames - 1)
    return tuple(
        Case(name, point.quality, name, frames, kept=kept, plain=point.plain) for name in FILMS
    )


def _record(
    point: Point,
    found: Sequence[Measurement],
    truth: Mapping[str, np.ndarray],
    converged: np.ndarray,
) -> dict[str, Any]:
    runs = [run for each in found for run in each.runs]
    pictures = found[0].pictures
    errors = [picture_error(pictures[key], true) for key, true in truth.items()]
    peaks = [run.memory[-1] for run in runs if run.memory]
    loaded = [each.loaded_memory for each in found if each.loaded_memory is not None]
    return {
        "name": point.name,
        "kind": point.kind,
        "quality": asdict(point.quality),
        "seconds": _seconds(runs) | {"cold": asdict(spread([each.cold_seconds for each in found]))},
        "errors": {
            "float64": asdict(pooled(errors)),
            "converged": asdict(picture_error(pictures[STARTING], converged)),
        },
        "memory": {
            "loaded": max(loaded, default=None),
            "peak": max(peaks, default=None),
            "gpu": found[-1].gpu_memory,
        },
        "statistics": {run.case: dict(run.statistics) for run in runs},
        "machine": asdict(found[-1].machine),
    }


def _seconds(runs: Sequence[Run]) -> dict[str, Any]:
    """First frames of all films together, following ones film by film."""
    seconds = {"first": asdict(spread([run.seconds[0] for run in runs]))}
    for name in FILMS:
        following = [s for run in runs if run.case == name for s in run.seconds[1:]]
        seconds[name] = asdict(spread(following))
    return seconds
