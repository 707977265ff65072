"""Recorded cases of the paper's authors' release, which are not part of this repository."""

import os
from pathlib import Path

import pytest
import torch

figures: list[str] = []
"""What was measured, for the summary at the end of a run."""


def parity_case(name: str) -> dict:
    """One recorded case by file name; skips the test where it is not at hand.

    Looked for in the folder that PE_PARITY names, else beside the repository.
    """
    beside = Path(__file__).parents[2].parent / "shared" / "parity"
    path = Path(os.environ.get("PE_PARITY", beside)) / f"{name}.pt"
    if not path.is_file():
        pytest.skip(f"no recorded case {name}: set PE_PARITY to the folder that holds {name}.pt")
    return torch.load(path, weights_only=True)


def check_within(what: str, error: float, bar: float) -> None:
    """Note an error for the summary, and fail if it is above its bar (or no number)."""
    figures.append(f"{what}: {error:.1e} (at most {bar:.0e})")
    assert error <= bar, figures[-1]
