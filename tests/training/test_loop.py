import json
import math
import os
import signal
import threading

import pytest
import torch

from pe_runtime.checkpoint import load_checkpoint, save_checkpoint
from pe_runtime.contract.errors import CheckpointError
from pe_runtime.images import read_image
from pe_runtime.training import loop
from pe_runtime.training.loop import (
    CHECKPOINT,
    CURVES,
    METRICS,
    SAMPLES,
    BrokenStepError,
    Schedule,
    TrainingError,
    learning_rate_share,
    optimiser_tensors,
    restore_optimiser,
    run,
)


class Line:
    """Fits a line to noisy points by Adam; any step can be made to go wrong."""

    def __init__(self, start=0.0, at=None, action=None):
        self.weight = torch.nn.Parameter(torch.full((2,), start))
        self.optimiser = torch.optim.Adam([self.weight], lr=0.1)
        self.seen, self.at, self.action = [], at, action

    def step(self, progress):
        self.seen.append(progress)
        x = torch.randn(16)
        loss = (self.weight[0] * x + self.weight[1] - 3 * x + 1).square().mean()
        self.optimiser.zero_grad()
        loss.backward()
        self.optimiser.step()
        if self.at == len(self.seen):
            return self.action() or {"loss": math.nan, "other": 1.0}
        return {"loss": float(loss.detach()), "other": 1.0}

    def evaluate(self):
        return {"measured": float(self.weight.detach().sum())}

    def tensors(self):
        state = {"weight": self.weight.detach()}
        return state | optimiser_tensors(self.optimiser, "optimiser")

    def restore(self, tensors):
        self.weight.data.copy_(tensors["weight"])
        restore_optimiser(self.optimiser, tensors, "optimiser")


def lines(folder):
    return [json.loads(line) for line in (folder / METRICS).read_text().splitlines()]


def equal(one, other):
    first, second = one.tensors(), other.tensors()
    assert first.keys() == second.keys()
    return all(torch.equal(first[name], second[name]) for name in first)


def test_training_lowers_the_loss_and_logs_means_of_the_steps_between(tmp_path):
    phase, told = Line(), []
    schedule = Schedule(steps=25, log_every=10)
    steps = run(phase, tmp_path, schedule, on_log=lambda s, f: told.append((s, f)))
    assert steps == 25
    logged = lines(tmp_path)
    assert [each["step"] for each in logged] == [10, 20, 25]
    assert logged[-1]["loss"] < logged[0]["loss"]
    assert all(each["other"] == 1 and each["minutes"] >= 0 for each in logged)
    assert [step for step, _ in told] == [10, 20, 25]
    assert phase.seen == [step / 25 for step in range(25)]


def test_measurements_join_the_log(tmp_path):
    run(Line(), tmp_path, Schedule(steps=6, log_every=4, evaluate_every=3))
    found = {each["step"]: set(each) - {"step", "minutes"} for each in lines(tmp_path)}
    assert found == {3: {"measured"}, 4: {"loss", "other"}, 6: {"loss", "other", "measured"}}


def test_the_same_seed_repeats_a_run_and_another_does_not(tmp_path):
    runs = []
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        torch.manual_seed(len(name))
        runs.append(Line())
        run(runs[-1], tmp_path / name, Schedule(steps=4, seed=seed))
    assert equal(runs[0], runs[1])
    assert not equal(runs[0], runs[2])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_run_that_is_interrupted_and_resumed_ends_like_one_that_was_not(tmp_path, number):
    whole = Line()
    schedule = Schedule(steps=9, checkpoint_every=100)
    run(whole, tmp_path / "whole", schedule)
    interrupted = Line(at=4, action=lambda: os.kill(os.getpid(), number) or {"loss": 1.0})
    assert run(interrupted, tmp_path / "parts", schedule) == 4
    assert load_checkpoint(tmp_path / "parts" / CHECKPOINT)[0]["step"] == 4
    resumed = Line(start=9.0)
    assert run(resumed, tmp_path / "parts", schedule, resume=True) == 9
    assert resumed.seen == [step / 9 for step in range(4, 9)]
    assert equal(whole, resumed)


def test_the_signal_handlers_are_those_from_before_when_the_run_is_over(tmp_path):
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    run(Line(), tmp_path, Schedule(steps=1))
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


def test_a_second_ctrl_c_stops_at_once(tmp_path):
    def press_twice():
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        run(Line(at=2, action=press_twice), tmp_path, Schedule(steps=5))


def test_a_run_outside_the_main_thread_works(tmp_path):
    phase = Line()
    thread = threading.Thread(target=run, args=(phase, tmp_path, Schedule(steps=3)))
    thread.start()
    thread.join()
    assert load_checkpoint(tmp_path / CHECKPOINT)[0]["step"] == 3


def test_a_loss_that_is_not_finite_keeps_the_last_checkpoint(tmp_path):
    phase = Line(at=6, action=lambda: None)
    with pytest.raises(TrainingError, match=r"step 5: loss is not finite.*lower learning rate"):
        run(phase, tmp_path, Schedule(steps=9, checkpoint_every=2))
    header, tensors = load_checkpoint(tmp_path / CHECKPOINT)
    assert header["step"] == 4
    assert torch.isfinite(tensors["weight"]).all()
    assert run(Line(), tmp_path, Schedule(steps=9), resume=True) == 9


def test_resuming_without_a_checkpoint_is_one_clear_error(tmp_path):
    with pytest.raises(CheckpointError, match="no checkpoint"):
        run(Line(), tmp_path / "empty", Schedule(steps=3), resume=True)


def test_a_model_is_no_state_of_a_run(tmp_path):
    save_checkpoint(tmp_path / CHECKPOINT, {}, {"kind": "model"})
    with pytest.raises(CheckpointError, match="is a model"):
        run(Line(), tmp_path, Schedule(steps=3), resume=True)


def test_resuming_a_finished_run_makes_no_step(tmp_path):
    run(Line(), tmp_path, Schedule(steps=3))
    again = Line(start=5.0)
    assert run(again, tmp_path, Schedule(steps=3), resume=True) == 3
    assert again.seen == []


class Clock:
    """Half a minute passes at every look."""

    def __init__(self):
        self.now = 0.0

    def monotonic(self):
        self.now += 30.0
        return self.now


def test_the_schedule_follows_the_clock_when_that_ends_first(tmp_path, monkeypatch):
    monkeypatch.setattr(loop, "time", Clock())
    phase = Line()
    assert run(phase, tmp_path, Schedule(steps=1000, minutes=3.0)) == 6
    assert phase.seen == pytest.approx([0, 1 / 6, 2 / 6, 3 / 6, 4 / 6, 5 / 6])


def test_a_resumed_run_under_a_time_limit_repeats_the_very_steps(tmp_path, monkeypatch):
    schedule = Schedule(steps=1000, minutes=3.0, checkpoint_every=1000)
    whole, resumed = Line(), Line(start=9.0)
    interrupted = Line(at=2, action=lambda: os.kill(os.getpid(), signal.SIGINT) or {"loss": 1.0})
    for phase, name in ((whole, "whole"), (interrupted, "parts")):
        monkeypatch.setattr(loop, "time", Clock())
        run(phase, tmp_path / name, schedule)
    monkeypatch.setattr(loop, "time", Clock())
    assert run(resumed, tmp_path / "parts", schedule, resume=True) == len(whole.seen)
    assert interrupted.seen + resumed.seen == whole.seen
    assert equal(whole, resumed)


def test_a_run_that_was_killed_goes_on_from_its_checkpoint_without_double_figures(
    tmp_path, monkeypatch
):
    schedule = Schedule(steps=8, log_every=1, checkpoint_every=3)

    def die(step, _):
        if step == 5:
            raise RuntimeError("the power is gone")

    with pytest.raises(RuntimeError):
        run(Line(), tmp_path / "parts", schedule, on_log=die)
    with (tmp_path / "parts" / METRICS).open("a") as cut_short:
        cut_short.write('{"step": 6, "lo')
    resumed, whole = Line(), Line()
    assert run(resumed, tmp_path / "parts", schedule, resume=True) == 8
    run(whole, tmp_path / "whole", schedule)
    assert equal(whole, resumed)
    found = [
        [(each["step"], each["loss"]) for each in lines(tmp_path / n)] for n in ("parts", "whole")
    ]
    assert found[0] == found[1]


def test_an_interrupt_and_the_terminate_that_torchrun_adds_are_one_wish(tmp_path):
    def both():
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGTERM)
        return {"loss": 1.0}

    assert run(Line(at=2, action=both), tmp_path, Schedule(steps=5)) == 2


def test_every_step_is_told_and_the_curves_are_drawn(tmp_path):
    told = []
    run(Line(), tmp_path, Schedule(steps=6, log_every=2, evaluate_every=3), on_step=told.append)
    assert [(each.step, each.steps) for each in told] == [(n, 6) for n in range(1, 7)]
    assert told[2].progress == 0.5
    assert told[0].figures["loss"] > told[5].figures["loss"]
    assert read_image(tmp_path / CURVES).shape[2] >= 3


class Painter(Line):
    """Shows what it measured, after the first measurement."""

    def sheet(self):
        return torch.full((4, 6, 3), 0.5) if len(self.seen) > 3 else None


def test_sheets_are_kept_of_phases_that_have_them(tmp_path):
    run(Painter(), tmp_path, Schedule(steps=6, evaluate_every=3))
    assert [path.name for path in (tmp_path / SAMPLES).iterdir()] == ["0000006.png"]
    assert read_image(tmp_path / SAMPLES / "0000006.png").shape == (4, 6, 3)


class Breaking(Line):
    """Finds at its third step that the loss is not finite, before it changes a weight."""

    def step(self, progress):
        if len(self.seen) == 2:
            raise BrokenStepError({"loss": math.nan, "other": 1.0}, {"batch": torch.arange(3)})
        return super().step(progress)


def test_the_batch_of_a_broken_step_is_kept_and_named(tmp_path):
    with pytest.raises(TrainingError, match=r"step 2: loss is not finite.*broken-0000002") as told:
        run(Breaking(), tmp_path, Schedule(steps=5, seed=4))
    assert "lower learning rate" in str(told.value)
    header, tensors = load_checkpoint(tmp_path / "broken-0000002.safetensors")
    assert (header["kind"], header["step"], header["seed"]) == ("broken step", 2, 4)
    assert (header["progress"], header["figures"]) == (2 / 5, {"loss": "nan", "other": "1.0"})
    assert torch.equal(tensors["batch"], torch.arange(3))


def test_the_learning_rate_warms_up_and_falls_along_a_cosine():
    assert learning_rate_share(0.0, 0.1) == pytest.approx(0, abs=1e-6)
    assert learning_rate_share(0.05, 0.1) == pytest.approx(0.5)
    assert learning_rate_share(0.1, 0.1) == 1
    assert learning_rate_share(0.55, 0.1) == pytest.approx(0.5)
    assert learning_rate_share(1.0, 0.1) == pytest.approx(0)
    assert learning_rate_share(0.0) == 1


@pytest.mark.parametrize(
    ("rates", "middle", "end"),
    [("constant", 1.0, 1.0), ("exponential", 0.1, 0.01), ("stairs", 0.1, 0.01)],
)
def test_the_other_learning_rates_start_at_one_and_end_where_they_should(rates, middle, end):
    at = [learning_rate_share(each, 0.1, rates, 0.01) for each in (0.05, 0.1, 0.55, 1.0)]
    assert at == pytest.approx([0.5, 1.0, middle, end])


def test_stairs_are_thirty_and_those_of_the_release():
    found = [
        learning_rate_share(step / 300_000, 0.0, "stairs", 0.1) for step in range(0, 300_000, 500)
    ]
    assert len(set(found)) == 30
    assert found[19] == 1
    assert found[20] == pytest.approx(0.926118, rel=1e-5)


def test_an_optimiser_that_made_no_step_has_nothing_to_restore():
    fresh = torch.optim.Adam([torch.nn.Parameter(torch.ones(2))])
    assert optimiser_tensors(fresh, "o") == {}
    restore_optimiser(fresh, {"other.0.step": torch.tensor(1.0)}, "o")
    assert not fresh.state_dict()["state"]


def test_a_new_run_does_not_overwrite_the_folder_of_another(tmp_path):
    run(Line(), tmp_path, Schedule(steps=2))
    before = (tmp_path / "checkpoint.safetensors").read_bytes()
    with pytest.raises(TrainingError, match="another run"):
        run(Line(), tmp_path, Schedule(steps=2))
    assert (tmp_path / "checkpoint.safetensors").read_bytes() == before
