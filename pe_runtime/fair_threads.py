"""How many threads drawing may use on a machine that has other work to do.

OpenMP's threads spin while they wait for each other. On a machine that is free that is the fastest
way; beside another busy program it is the slowest by far, because the one that is waited for gets
no turn. So every frame looks at what it lost to others, and if that was much, the next ones use
only as many threads as had a core to themselves.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import torch

try:
    import resource
except ImportError:  # Windows does not tell
    resource = None

SHARE = 0.85
"""Share of their time that threads get on a machine which is free."""
TURN = 8e-3
"""Seconds that a thread waits for its next turn, at most; schedulers give turns of 3 or 4 ms."""
SHORTEST = 5e-3
"""Seconds of drawing below which nothing is learnt."""
FIRST_PAUSE, LONGEST_PAUSE = 1.0, 30.0
"""Seconds after which all threads are tried again; doubled each time in which that was no good."""


@dataclass(frozen=True)
class Usage:
    """What a process had used up at some moment.

    Attributes:
        wall: Seconds on the clock.
        cpu: Seconds that its threads ran, together.
        preempted: How often a thread of its had to make room for another program.
    """

    wall: float
    cpu: float
    preempted: int


def usage() -> Usage | None:
    """What this process has used up until now; None where the system does not tell."""
    if resource is None:
        return None
    spent = resource.getrusage(resource.RUSAGE_SELF)
    return Usage(time.perf_counter(), spent.ru_utime + spent.ru_stime, spent.ru_nivcsw)


class FairThreads:
    """Gives all threads of torch while the machine is free, fewer while it is not.

    What is computed never depends on the number of threads.

    Args:
        look: `usage`; another one in tests.
    """

    def __init__(self, look: Callable[[], Usage | None] = usage) -> None:
        self._look = look
        self._fewer = 0
        self._again = 0.0
        self._pause = FIRST_PAUSE

    @contextmanager
    def sharing(self) -> Iterator[None]:
        """Draw one frame with as many threads as there are cores to spare."""
        everyone, began = torch.get_num_threads(), self._look()
        if began is None or everyone == 1:
            yield
            return
        crowded = began.wall < self._again
        if crowded:
            torch.set_num_threads(min(self._fewer, everyone))
        try:
            yield
        finally:
            if crowded:
                torch.set_num_threads(everyone)
            else:
                self._learn(everyone, began, self._look())

    def _learn(self, threads: int, began: Usage, ended: Usage) -> None:
        wall, cpu = ended.wall - began.wall, ended.cpu - began.cpu
        if wall < SHORTEST:
            return
        lost = threads * wall - cpu
        # Threads that sleep while they wait lose time too, but not to others.
        taken = (ended.preempted - began.preempted) * TURN >= lost
        if lost <= (1 - SHARE) * threads * wall or not taken:
            self._pause = FIRST_PAUSE
            return
        self._fewer = max(1, int(cpu / wall))
        self._again = ended.wall + self._pause
        self._pause = min(2 * self._pause, LONGEST_PAUSE)
