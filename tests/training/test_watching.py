"""What a live display says of a training, and when there is none."""

import io
import sys

import pytest
from rich.console import Console
from rich.progress import Progress, TextColumn

from pe_runtime.cli import watching as module
from pe_runtime.cli.watching import Watch, told, watching
from pe_runtime.training.loop import Moment


class Clock:
    """Two seconds pass at every look."""

    def __init__(self):
        self.seconds = 0.0

    def __call__(self):
        self.seconds += 2.0
        return self.seconds


@pytest.fixture
def bar():
    console = Console(file=io.StringIO(), width=200)
    return Progress(TextColumn("{task.fields[said]}|{task.fields[left]}"), console=console)


def moments(count, first=1, steps=10):
    for step in range(first, first + count):
        yield Moment(
            step, steps, step / steps, {"loss": 1.0 / step, "psnr_patch": 20.0, "rate": 1e-3}
        )


def test_it_tells_step_loss_rate_and_time_left(bar):
    watch = Watch(bar, Clock())
    for moment in moments(5):
        watch.stepped(moment)
    (task,) = bar.tasks
    said = task.fields["said"]
    assert said.startswith("step 5/10, loss 0.")
    assert "psnr_patch 20" in said and "rate" not in said
    # Looks: one when the first step ended, and one at every step.
    assert "0.40 steps/s" in said
    assert task.fields["left"] == "0:00:12 left"
    assert task.completed == pytest.approx(0.5)


def test_a_resumed_run_counts_its_pace_from_where_it_went_on(bar):
    watch = Watch(bar, Clock())
    for moment in moments(3, first=7):
        watch.stepped(moment)
    (task,) = bar.tasks
    assert task.completed == pytest.approx(0.9)
    assert task.fields["left"].startswith("0:00:0")


def test_held_out_figures_stay_in_view(bar):
    watch = Watch(bar, Clock())
    (first, second) = moments(2)
    watch.stepped(first)
    watch.logged(1, {"loss": 1.0, "psnr_box": 17.25})
    watch.stepped(second)
    assert "psnr_box 17.25" in bar.tasks[0].fields["said"]


def test_a_second_training_gets_a_bar_of_its_own(bar):
    watch = Watch(bar, Clock())
    for _ in range(2):
        for moment in moments(2):
            watch.stepped(moment)
    assert len(bar.tasks) == 2


def test_lines_are_told_where_there_is_no_terminal(capsys):
    with watching(True) as (on_log, on_step):
        assert on_step is None
        on_log(20, {"loss": 0.25})
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", "step 20: loss 0.25\n")


def test_a_terminal_gets_a_live_line_only_when_it_is_asked_for(monkeypatch, capsys):
    monkeypatch.setattr(
        module, "Console", lambda stderr: Console(file=io.StringIO(), force_terminal=True)
    )
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    with watching(False) as calls:
        assert calls == (told, None)
    with watching(True) as (on_log, on_step):
        for moment in moments(2):
            on_step(moment)
        on_log(2, {"psnr": 20.0})
    assert capsys.readouterr() == ("", "")
