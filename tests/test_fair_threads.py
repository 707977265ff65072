"""Frames use all threads while the machine is free, fewer while others need it."""

import pytest
import torch

from pe_runtime import fair_threads
from pe_runtime.fair_threads import FIRST_PAUSE, LONGEST_PAUSE, FairThreads, Usage, usage


class Machine:
    """A clock and a processor that a test moves on."""

    def __init__(self):
        self.now = Usage(100.0, 0.0, 0)

    def frame(self, fair, seconds=0.1, cores=2.0, preempted=0):
        """Draw one frame; how many threads it had."""
        with fair.sharing():
            threads = torch.get_num_threads()
            cpu = min(cores, threads) * seconds
            self.spend(seconds, cpu, preempted)
        return threads

    def spend(self, wall, cpu=0.0, preempted=0):
        now = self.now
        self.now = Usage(now.wall + wall, now.cpu + cpu, now.preempted + preempted)


@pytest.fixture(autouse=True)
def two_threads():
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    yield
    assert torch.get_num_threads() == 2
    torch.set_num_threads(before)


@pytest.fixture
def machine():
    return Machine()


@pytest.fixture
def fair(machine):
    return FairThreads(lambda: machine.now)


def test_on_a_free_machine_every_frame_has_all_threads(machine, fair):
    assert [machine.frame(fair) for _ in range(5)] == [2] * 5


def test_beside_a_busy_program_the_next_frames_have_one_thread_less(machine, fair):
    assert machine.frame(fair, cores=1.4, preempted=20) == 2
    assert machine.frame(fair) == 1
    assert machine.frame(fair) == 1


def test_after_a_pause_all_threads_are_tried_again(machine, fair):
    machine.frame(fair, cores=1.4, preempted=20)
    machine.spend(FIRST_PAUSE - 0.2)
    assert machine.frame(fair) == 1
    machine.spend(0.2)
    assert [machine.frame(fair) for _ in range(3)] == [2, 2, 2]


def test_the_pause_doubles_while_the_machine_stays_busy_and_no_longer_than_the_longest(
    machine, fair
):
    pauses = []
    for _ in range(8):
        assert machine.frame(fair, cores=1.4, preempted=20) == 2
        began = machine.now.wall
        while machine.now.wall < fair._again:
            assert machine.frame(fair) == 1
            machine.spend(0.4)
        pauses.append(round(machine.now.wall - began))
    assert pauses[:4] == [1, 2, 4, 8]
    assert max(pauses) == LONGEST_PAUSE


def test_threads_that_merely_sleep_are_no_sign_of_a_busy_machine(machine, fair):
    machine.frame(fair, cores=1.2, preempted=2)
    assert machine.frame(fair) == 2


def test_frames_too_short_to_tell_teach_nothing(machine, fair):
    machine.frame(fair, seconds=0.001, cores=0.5, preempted=5)
    assert machine.frame(fair) == 2


def test_a_frame_that_fails_leaves_the_threads_as_they_were(machine, fair):
    machine.frame(fair, cores=1.4, preempted=20)
    with pytest.raises(ZeroDivisionError), fair.sharing():
        assert torch.get_num_threads() == 1
        raise ZeroDivisionError


def test_where_the_system_tells_nothing_all_threads_are_used(monkeypatch):
    monkeypatch.setattr(fair_threads, "resource", None)
    assert usage() is None
    with FairThreads().sharing():
        assert torch.get_num_threads() == 2


def test_what_a_process_has_used_only_grows():
    if fair_threads.resource is None:
        pytest.skip("this system does not tell")
    before = usage()
    torch.randn(300, 300) @ torch.randn(300, 300)
    after = usage()
    assert after.wall > before.wall
    assert after.cpu >= before.cpu
    assert after.preempted >= before.preempted
