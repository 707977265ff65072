"""What episodes keep of the release's other annotations, for people to read."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pe_runtime.interop.dataset_values import Pose

DEEPEST, MOST = 8, 200_000
"""Nested containers, and values of one kind in one episode."""
LARGEST = 2**63
LEFT_OUT = "left out: too large"


def readable(extras: Mapping[str, Any], frames: range) -> dict[str, Any]:
    """The entries of some frames, as JSON can hold them.

    Args:
        extras: Lists over all frames of a sequence, by name; anything else is kept whole.
        frames: Those to keep.
    """
    kept = {}
    for name, found in extras.items():
        if isinstance(found, list | tuple):
            found = [found[frame] for frame in frames if frame < len(found)]
        try:
            kept[name] = _Budget(MOST).plain(found, DEEPEST)
        except OverflowError:
            kept[name] = LEFT_OUT
    return kept


@dataclass
class _Budget:
    """How many values may still come: one list may stand in many places, and become a huge tree."""

    left: int

    def plain(self, value: Any, depth: int) -> Any:  # noqa: ANN401 any data, any JSON
        """Numbers, texts, lists and dictionaries with text keys.

        Raises:
            OverflowError: It is too deep or too large.
        """
        self.left -= 1 + (len(value) // 64 if isinstance(value, str) else 0)
        if self.left < 0 or depth < 0:
            raise OverflowError
        if isinstance(value, Pose):
            value = {"rotation": value.rotation, "translation": value.translation}
        if isinstance(value, np.ndarray | np.generic):
            value = value.tolist()
        if isinstance(value, dict):
            texts = [str(self.plain(key, depth - 1)) for key in value]
            entries = [self.plain(each, depth - 1) for each in value.values()]
            return dict(zip(texts, entries, strict=True))
        if isinstance(value, list | tuple | set | frozenset):
            return [self.plain(each, depth - 1) for each in value]
        return _scalar(value)


def _scalar(value: object) -> str | int | float | None:
    if isinstance(value, int) and abs(value) >= LARGEST:
        raise OverflowError
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if isinstance(value, str | int | float | None) else type(value).__name__
