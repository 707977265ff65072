"""Numerical stability as a table: every stress case in every precision, against float64."""

import itertools
import math
import random
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from pe_runtime.benchmark.stress_actions import ACTING
from pe_runtime.benchmark.stress_cameras import CAMERAS
from pe_runtime.benchmark.stress_cases import Case, Measured, Trial, Weigh, worst
from pe_runtime.benchmark.stress_compositing import COMPOSITING, WEIGHING, subtracting
from pe_runtime.benchmark.stress_geometry import GEOMETRY
from pe_runtime.benchmark.stress_losses import LOSSES
from pe_runtime.benchmark.stress_perception import PERCEPTION
from pe_runtime.benchmark.stress_pictures import PICTURES
from pe_runtime.benchmark.stress_rollout import ROLLOUT
from pe_runtime.rendering.compositing import weights_from_thickness

CASES: tuple[Case, ...] = (
    *COMPOSITING,
    *GEOMETRY,
    *CAMERAS,
    *PERCEPTION,
    *PICTURES,
    *LOSSES,
    *ACTING,
    *ROLLOUT,
)
CORNERS = 24
"""Up to so many combinations of corners are all tried; of more, each value once or oftener."""
HEADINGS = (
    "case",
    "precision",
    "points",
    "error",
    "bound",
    "gradient error",
    "bound",
    "not finite",
    "",
)


@dataclass(frozen=True)
class StressRow:
    """One case in one precision.

    Attributes:
        case: What was stressed.
        precision: "float64", "float32" or "bfloat16".
        points: How many points of the case's ranges were tried.
        forward: Worst result.
        backward: Worst gradient; None where nothing is differentiated.
        rule: Unit and bound of the error, in words.
    """

    case: str
    precision: str
    points: int
    forward: Measured
    backward: Measured | None
    rule: str

    @property
    def nonfinite(self) -> int:
        """Results and gradients that are not finite."""
        return self.forward.nonfinite + (self.backward.nonfinite if self.backward else 0)

    @property
    def passed(self) -> bool:
        """Whether results and gradients are finite and within their bounds."""
        return self.forward.passed and (self.backward is None or self.backward.passed)


@dataclass(frozen=True)
class StressReport:
    """What came out of all cases.

    Attributes:
        rows: One per case and precision.
        broken: The cases again with a deliberately broken sum; every one of them has to fail.
        seed: Of everything that was drawn.
    """

    rows: tuple[StressRow, ...]
    broken: tuple[StressRow, ...]
    seed: int

    @property
    def passed(self) -> bool:
        """Whether all rows pass, and what is broken does not."""
        return all(row.passed for row in self.rows) and not any(row.passed for row in self.broken)

    def as_dict(self) -> dict[str, Any]:
        """JSON-able form; infinite bounds and errors become None."""
        return {
            "passed": self.passed,
            "seed": self.seed,
            "rows": [_as_dict(row) for row in self.rows],
            "broken": [_as_dict(row) for row in self.broken],
        }


def run_stress(
    on_progress: Callable[[int, int], None] = lambda done, total: None,
    seed: int = 0,
    weigh: Weigh = weights_from_thickness,
) -> StressReport:
    """Try every case in every precision.

    Args:
        on_progress: Called after every row with the rows done and their number.
        seed: Of everything that is drawn.
        weigh: How thicknesses become weights; anything but the runtime's own is expected to fail.
    """
    plan = [(case, precision) for case in CASES for precision in case.precisions]
    broken = [(case, precision) for case in WEIGHING for precision in case.precisions]
    rows = []
    for number, (case, precision) in enumerate([*plan, *broken], start=1):
        by = weigh if number <= len(plan) else subtracting
        rows.append(run_case(case, precision, seed, by))
        on_progress(number, len(plan) + len(broken))
    return StressReport(tuple(rows[: len(plan)]), tuple(rows[len(plan) :]), seed)


def run_case(
    case: Case, precision: str, seed: int = 0, weigh: Weigh = weights_from_thickness
) -> StressRow:
    """Try one case at the corners of its ranges and at some points between."""
    outcomes = []
    for number, values in enumerate(points(case, seed)):
        outcomes.append(case.measure(Trial(values, precision, seed + number, weigh)))
    backward = [each.backward for each in outcomes if each.backward is not None]
    return StressRow(
        case.name,
        precision,
        len(outcomes),
        worst([each.forward for each in outcomes]),
        worst(backward) if backward else None,
        case.rule,
    )


def points(case: Case, seed: int) -> Iterator[Mapping[str, float]]:
    """Corners of a case's ranges, then draws from within them."""
    spreads = case.ranges
    yield from case.tried or _corners(case)
    drawn = random.Random(seed)
    for _ in range(case.draws):
        yield {name: each.at(drawn.random()) for name, each in spreads.items()}


def _corners(case: Case) -> Iterator[dict[str, float]]:
    spreads = case.ranges
    sizes = [len(each.corners) for each in spreads.values()]
    if math.prod(sizes) <= CORNERS:
        for values in itertools.product(*(each.corners for each in spreads.values())):
            yield dict(zip(spreads, values, strict=True))
        return
    for number in range(max(CORNERS, *sizes)):
        # Every time round, each spread is a different number of corners ahead of the first.
        yield {
            name: each.corners[(number + place * (number // len(each.corners))) % len(each.corners)]
            for place, (name, each) in enumerate(spreads.items())
        }


def stress_table(report: StressReport) -> list[tuple[str, ...]]:
    """The report as rows of text, headings first; the broken variant comes last."""
    rows = [HEADINGS]
    for row in report.rows:
        rows.append((*_cells(row), "pass" if row.passed else "FAIL"))
    for row in report.broken:
        row = replace(row, case=f"broken on purpose (subtracted sum): {row.case}")
        rows.append((*_cells(row), "fails, as it must" if not row.passed else "PASSES: cannot be"))
    return rows


def _cells(row: StressRow) -> tuple[str, ...]:
    ends = [*_numbers(row.forward), *_numbers(row.backward)]
    return (row.case, row.precision, str(row.points), *ends, str(row.nonfinite))


def _numbers(measured: Measured | None) -> tuple[str, str]:
    if measured is None:
        return "", ""
    if math.isinf(measured.bound):
        return "", "finite"
    return f"{measured.error:.1e}", f"{measured.bound:.1e}"


def _as_dict(row: StressRow) -> dict[str, Any]:
    found = asdict(row) | {"nonfinite": row.nonfinite, "passed": row.passed}
    for name in ("forward", "backward"):
        measured = found[name]
        if measured is not None:
            found[name] = {k: v if math.isfinite(v) else None for k, v in measured.items()}
    return found
