"""Every stress case, drawn from the whole of its ranges and not only at their corners."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pe_runtime.benchmark.stress import CASES
from pe_runtime.benchmark.stress_cases import Trial

PAIRS = [(case, precision) for case in CASES for precision in case.precisions]


def anything_in(spread):
    """A corner of a range, or any number between its ends."""
    between = st.floats(0.0, 1.0).map(spread.at)
    return st.one_of(st.sampled_from(spread.corners), between)


@pytest.mark.parametrize(
    ("case", "precision"), PAIRS, ids=[f"{case.name}, {precision}" for case, precision in PAIRS]
)
def test_anywhere_in_its_ranges_a_case_is_finite_and_within_its_bound(case, precision):
    points = st.fixed_dictionaries({n: anything_in(each) for n, each in case.ranges.items()})

    @settings(max_examples=case.examples)
    @given(values=points, seed=st.integers(0, 10_000))
    def holds(values, seed):
        outcome = case.measure(Trial(values, precision, seed))
        assert outcome.forward.passed, outcome.forward
        assert outcome.backward is None or outcome.backward.passed, outcome.backward

    holds()
