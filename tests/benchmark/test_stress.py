import json
import math

import numpy as np
import pytest
import torch

from pe_runtime.benchmark import stress
from pe_runtime.benchmark.stress import CASES, points, run_case, run_stress, stress_table
from pe_runtime.benchmark.stress_cases import (
    Case,
    Measured,
    Outcome,
    Spread,
    Trial,
    compare,
    finite,
    one_of,
    within_one,
    worst,
)
from pe_runtime.benchmark.stress_compositing import COMPOSITING, WEIGHING, subtracting

HUGE = {"density": 1e30, "samples": 64.0, "scale": 1.0}


@pytest.fixture
def few_cases(monkeypatch):
    monkeypatch.setattr(stress, "CASES", COMPOSITING[:1])


@pytest.mark.parametrize("case", WEIGHING, ids=[case.name for case in WEIGHING])
@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
def test_a_subtracted_cumulative_sum_is_seen_to_fail_at_huge_densities(case, precision):
    values = {name: HUGE[name] for name in case.ranges}
    sound = case.measure(Trial(values, precision))
    broken = case.measure(Trial(values, precision, weigh=subtracting))
    assert sound.forward.passed and sound.backward.passed
    assert not broken.forward.passed


def test_at_ordinary_densities_the_subtracted_sum_would_not_be_seen():
    values = {"density": 1e-3, "samples": 2.0}
    assert WEIGHING[0].measure(Trial(values, weigh=subtracting)).forward.error < 1e-5


@pytest.mark.parametrize("case", WEIGHING, ids=[case.name for case in WEIGHING])
def test_the_row_of_the_broken_sum_fails_and_the_row_of_the_sound_one_passes(case):
    assert run_case(case, "float32").passed
    assert not run_case(case, "float32", weigh=subtracting).passed


@pytest.mark.usefixtures("few_cases")
def test_a_report_passes_when_its_rows_do_and_what_is_broken_does_not():
    done = []
    report = run_stress(lambda *each: done.append(each))
    assert report.passed
    assert [row.passed for row in report.broken] == [False] * 4
    assert done == [(number, 6) for number in range(1, 7)]


@pytest.mark.usefixtures("few_cases")
def test_a_report_of_the_broken_sum_in_place_of_ours_fails():
    assert not run_stress(weigh=subtracting).passed


@pytest.mark.usefixtures("few_cases")
def test_a_report_in_which_the_broken_sum_passed_would_fail(monkeypatch):
    monkeypatch.setattr(stress, "subtracting", stress.weights_from_thickness)
    assert not run_stress().passed


@pytest.mark.usefixtures("few_cases")
def test_a_report_is_json_and_a_table_with_a_line_for_what_is_broken():
    report = run_stress()
    stored = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    assert stored["passed"] and stored["rows"][0]["rule"]
    headings, *rows = stress_table(report)
    assert {len(row) for row in rows} == {len(headings)}
    assert [row[-1] for row in rows] == ["pass"] * 2 + ["fails, as it must"] * 4
    assert all("broken on purpose" in row[0] for row in rows[2:])


@pytest.mark.usefixtures("few_cases")
def test_the_same_seed_gives_the_same_report():
    first, again, other = (run_stress(seed=seed) for seed in (3, 3, 4))
    assert first == again
    assert first.rows[0].forward != other.rows[0].forward


def test_every_case_has_its_own_name_a_rule_and_both_kinds_of_precision():
    assert len({case.name for case in CASES}) == len(CASES)
    assert all(case.rule and len(case.precisions) >= 1 for case in CASES)
    assert {p for case in CASES for p in case.precisions} == {"float64", "float32", "bfloat16"}


@pytest.mark.parametrize("case", [c for c in CASES if not c.tried], ids=lambda case: case.name)
def test_every_corner_of_every_range_is_tried(case):
    tried = list(points(case, 0))
    for name, spread in case.ranges.items():
        assert set(spread.corners) <= {values[name] for values in tried}


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_points_lie_within_the_ranges(case):
    for values in points(case, 1):
        assert values.keys() == case.ranges.keys()
        for name, spread in case.ranges.items():
            assert min(spread.corners) <= values[name] <= max(spread.corners)


@pytest.mark.parametrize(
    ("spread", "middle"),
    [
        (Spread((1e-3, 1.0, 1e6)), 10**1.5),
        (Spread((0.0, 1e-2, 1e2, math.inf)), 1.0),
        (Spread((-3.0, 5.0), "linear"), 1.0),
        (Spread((1.0, 2.0, 4096.0), "whole"), 64.0),
        (one_of(["a", "b", "c"]), 1.0),
    ],
)
def test_the_middle_of_a_spread_is_on_its_scale(spread, middle):
    assert spread.at(0.5) == pytest.approx(middle)
    ends = [each for each in spread.corners if 0 < each < math.inf or spread.scale != "log"]
    assert (spread.at(0.0), spread.at(1.0)) == pytest.approx((ends[0], ends[-1]))


def test_what_is_not_finite_is_counted_and_never_passes():
    found = torch.tensor([1.0, math.nan, math.inf])
    measured = compare(found, torch.ones(3).double(), 1.0, 1.0)
    assert (measured.error, measured.nonfinite, measured.passed) == (0.0, 2, False)
    assert finite(found, None).nonfinite == 2
    assert finite(torch.ones(2)).passed


def test_an_error_is_measured_in_its_unit_and_held_to_its_bound():
    found, wanted = torch.tensor([1.0, 103.0]), torch.tensor([1.5, 100.0]).double()
    measured = compare(found, wanted, torch.tensor([1.0, 100.0]), 0.1)
    assert measured.error == pytest.approx(0.5) and not measured.passed
    assert compare(found, wanted, 100.0, 0.1).passed


def test_the_worst_is_the_one_nearest_its_bound_or_beyond():
    small, near, many = Measured(1e-9, 1e-3), Measured(1e-6, 2e-6), Measured(5.0, math.inf, 3)
    assert worst([small, near, many]) == Measured(1e-6, 2e-6, 3)
    assert worst([near, Measured(math.nan, 1.0)]).passed is False
    assert worst([near, Measured(1e-300, 0.0)]).passed is False
    assert (within_one(0.5), within_one(1.0)) == (0.5, math.inf)


def test_adding_a_case_is_one_entry():
    def root(trial):
        given = torch.tensor(trial["x"], dtype=trial.dtype)
        exact = torch.tensor(math.sqrt(given.double().item()), dtype=torch.float64)
        return Outcome(compare(given.sqrt(), exact, max(exact.item(), 1e-30), trial.epsilon))

    case = Case("square roots", {"x": Spread((0.0, 1e-20, 1e20))}, root, "1 eps of the root")
    row = run_case(case, "float32")
    assert row.passed and row.points == 7 and row.backward is None
    assert 0 < row.forward.error <= np.finfo(np.float32).eps
