"""Recorded cases of the paper's authors' release, which are not part of this repository."""

import os
from pathlib import Path

import pytest
import torch


def parity_case(name: str) -> dict:
    """One recorded case by file name; skips the test where it is not at hand.

    Looked for in the folder that PE_PARITY names, else beside the repository.
    """
    beside = Path(__file__).parents[2].parent / "shared" / "parity"
    path = Path(os.environ.get("PE_PARITY", beside)) / f"{name}.pt"
    if not path.is_file():
        pytest.skip(f"no recorded case {name}: set PE_PARITY to the folder that holds {name}.pt")
    return torch.load(path, weights_only=True)
