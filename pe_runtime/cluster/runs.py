"""Runs of neighbouring frames: what one task draws."""

from collections.abc import Iterator, Sequence

LONGEST = 16
"""Frames of a run at most: what is lost and drawn again when a worker dies."""
ROUNDS = 3
"""Runs that each worker would get of what is left, if all were of the next one's length."""


def split_into_runs(frames: Sequence[int], workers: int) -> Iterator[tuple[int, ...]]:
    """Cut frames into runs, in order, shorter towards the end.

    Neighbours are cheap to draw after each other; short last runs let all workers end together.

    Args:
        frames: Frame numbers in ascending order; gaps are fine.
        workers: Workers that draw at the same time, at least 1.
    """
    begin = 0
    while begin < len(frames):
        left = len(frames) - begin
        end = begin + min(LONGEST, -(-left // (ROUNDS * workers)))
        yield tuple(frames[begin:end])
        begin = end
