"""What pixels, objects, samples and frames cost; each section in one process, cases interleaved."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from pe_runtime.benchmark.errors import picture_error
from pe_runtime.benchmark.jobs import Case, Measurement
from pe_runtime.benchmark.plan import Bench
from pe_runtime.benchmark.timing import Spread, log_slope, spread
from pe_runtime.config import QUALITIES

MEASURED = ("exact", "balanced")
SCALES = (0.5, 0.7, 1.0, 1.4, 2.0)
"""Widths of pictures, as shares of the scene's."""
FACTORS = (0.5, 1.0, 2.0, 4.0)
"""Of the samples per ray."""
COMPANY = (
    ("absent", 0),
    ("hidden", 0),
    ("as found", 0),
    ("more hidden", 10),
    ("out of view", 10),
    ("in view", 1),
    ("in view", 2),
    ("in view", 5),
    ("in view", 10),
)
"""Casts, and how many more players they have."""
FRAMES = 3


def measure_pixels(bench: Bench) -> dict[str, Any]:
    """Seconds per frame at several sizes, and the exponent of the pixels."""
    coarsest = bench.scene.environment.config.feature_renderer.strides[-1]
    camera = bench.scene.camera
    sizes = []
    for scale in SCALES:
        cells = [max(2, round(scale * n / coarsest)) for n in (camera.width, camera.height)]
        sizes.append((cells[0] * coarsest, cells[1] * coarsest))
    sizes = list(dict.fromkeys(sizes))
    cases = {
        (name, size): Case(f"{name} {size[0]}x{size[1]}", QUALITIES[name], "moving", FRAMES, *size)
        for name in MEASURED
        for size in sizes
    }
    seconds = _following(bench.run(tuple(cases.values()), bench.plan.repeats))
    section = {}
    for name in MEASURED:
        rows = [
            {"width": w, "height": h, "pixels": w * h}
            | {"seconds": asdict(seconds[cases[name, (w, h)].name])}
            for w, h in sizes
        ]
        slope = log_slope(
            [float(r["pixels"]) for r in rows], [r["seconds"]["median"] for r in rows]
        )
        section[name] = {"slope": slope, "sizes": rows}
    return section


def measure_objects(bench: Bench) -> list[dict[str, Any]]:
    """Seconds per frame with other casts; "relative" is to the scene as it was found."""
    if not bench.scene.environment.playable_names:
        return []
    exact = QUALITIES["exact"]
    cases = {
        (cast, count): Case(f"{cast} {count}", exact, "moving", FRAMES, cast=cast, count=count)
        for cast, count in COMPANY
    }
    found = bench.run(tuple(cases.values()), bench.plan.object_rounds)
    seconds, counters = _following(found), {run.case: run.statistics for run in found.runs}
    usual = seconds[cases["as found", 0].name].median
    return [
        {"cast": cast, "count": count, "quality": "exact"}
        | {"seconds": asdict(seconds[case.name]), "relative": seconds[case.name].median / usual}
        | {"statistics": dict(counters[case.name])}
        for (cast, count), case in cases.items()
    ]


def measure_samples(bench: Bench) -> list[dict[str, Any]]:
    """Seconds per frame and distance from the converged integral, by samples per ray."""
    exact = QUALITIES["exact"]
    cases = {
        factor: Case(f"{factor:g}", exact, "moving", FRAMES, samples=factor, kept=(0,))
        for factor in FACTORS
    }
    found = bench.run(tuple(cases.values()), bench.plan.repeats)
    converged = bench.truth("moving", 0, bench.plan.finer)
    seconds = _following(found)
    return [
        {"factor": factor, "quality": "exact", "seconds": asdict(seconds[case.name])}
        | {"converged": asdict(picture_error(found.pictures[f"{case.name}/0"], converged))}
        for factor, case in cases.items()
    ]


def measure_frames(bench: Bench) -> list[dict[str, Any]]:
    """Peak memory while a long film goes on; each film in a process of its own."""
    frames, records = bench.plan.long_film, []
    for name in ("moving", "standing"):
        found = bench.run((Case(name, QUALITIES["balanced"], name, frames),))
        run = found.runs[0]
        after = sorted({1, *(10**n for n in range(1, 9) if 10**n < frames), frames})
        memory = {str(n): run.memory[n - 1] for n in after} if run.memory else {}
        growth = run.memory[-1] / run.memory[0] - 1.0 if run.memory else None
        records.append(
            {"film": name, "quality": "balanced", "frames": frames}
            | {"memory": memory, "growth": growth}
            | {"seconds": asdict(spread(run.seconds[1:]))}
        )
    return records


def _following(found: Measurement) -> Mapping[str, Spread]:
    """Seconds of all frames but the first, by case."""
    seconds: dict[str, list[float]] = {}
    for run in found.runs:
        seconds.setdefault(run.case, []).extend(run.seconds[1:])
    return {name: spread(each) for name, each in seconds.items()}
