"""Two processes that train one model, started as a user starts them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
import team_member
import torch
from torch import nn

from pe_runtime.checkpoint import load_checkpoint
from pe_runtime.contract.errors import ConfigError
from pe_runtime.training.global_statistics import GlobalBatchNorm, share_statistics
from pe_runtime.training.processes import Team, Total, joined

MEMBER = Path(team_member.__file__)


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """Folder in which two processes have left what came of their trainings."""
    folder = tmp_path_factory.mktemp("pair")
    command = [sys.executable, "-m", "torch.distributed.run", "--standalone"]
    done = subprocess.run(
        [*command, "--nproc-per-node", "2", MEMBER, folder],
        env=os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": str(MEMBER.parents[1])},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return folder


def left(folder, name):
    return [load_checkpoint(folder / f"{name}-{rank}.safetensors")[1] for rank in (0, 1)]


@pytest.fixture(scope="module")
def alone():
    """The same training in one process with the doubled batch."""
    return team_member.train(2)


def under(tensors, prefix):
    return {name: each for name, each in tensors.items() if name.startswith(prefix)}


def test_both_processes_hold_the_same_weights_to_the_bit(pair):
    first, second = left(pair, "trained")
    assert first.keys() == second.keys()
    assert [name for name in first if not torch.equal(first[name], second[name])] == []


@pytest.mark.parametrize("kind", ["gradients", "statistics", "figures"])
def test_two_processes_get_what_one_gets_from_the_doubled_batch(pair, alone, kind):
    found, wanted = under(left(pair, "trained")[0], kind), under(alone, kind)
    assert found.keys() == wanted.keys()
    for name, each in wanted.items():
        torch.testing.assert_close(found[name], each, rtol=1e-5, atol=5e-6, msg=name)
    assert any(each.numel() and each.abs().max() > 1e-2 for each in wanted.values())


def test_weights_of_two_processes_are_those_of_one(pair, alone):
    found, equal, entries = left(pair, "trained")[0], 0, 0
    weights = {n for n in alone if n.replace("networks", "gradients.0") in alone}
    for name in sorted(weights - {n for n in alone if n.startswith("gradients")}):
        each = alone[name]
        # Where gradients are nothing but rounding (a bias before a normalisation, which takes it
        # out again), Adam makes whole steps of them, here these and there those.
        noise = torch.zeros_like(each, dtype=torch.bool)
        for step in range(team_member.STEPS):
            gradient = alone.get(name.replace("networks", f"gradients.{step}"), torch.zeros(0))
            if gradient.numel():
                noise |= (gradient != 0) & (gradient.abs() < 1e-6)
        near = (found[name] - each).abs() < 1e-5
        assert (near | noise).all(), name
        equal, entries = equal + int(near.sum()), entries + each.numel()
    assert equal > 0.999 * entries


def test_some_players_are_seen_by_one_process_alone(alone):
    """Otherwise the tests above say nothing about gradients that only one process has."""
    nowhere = [name for name, each in under(alone, "gradients").items() if not each.numel()]
    assert any("fields.player" in name for name in nowhere)
    assert any(alone[f"gradients.{step}.fields.player.output.weight"].numel() for step in range(4))


def test_a_signal_at_any_process_stops_all_and_the_resumed_run_is_the_same_to_the_bit(pair):
    for lived in left(pair, "lived"):
        assert int(lived["made"]) == 2
        whole, resumed = under(lived, "whole."), under(lived, "resumed.")
        assert [n for n in whole if not torch.equal(whole[n], lived["resumed" + n[5:]])] == []
        assert len(whole) == len(resumed) > 50


def test_only_the_first_process_writes_and_every_line_is_there_once(pair):
    assert len((pair / "parts" / "metrics.jsonl").read_text().splitlines()) == 4
    assert len((pair / "whole" / "metrics.jsonl").read_text().splitlines()) == 4


def test_a_loss_that_breaks_in_one_process_ends_all_and_leaves_the_whole_batch(pair):
    assert [int(lived["broken"]) for lived in left(pair, "lived")] == [1, 1]
    header, tensors = load_checkpoint(pair / "broken" / "broken-0000001.safetensors")
    assert header["step"] == 1
    assert tensors["images"].shape[0] == 4


def test_no_thread_of_the_exchange_outlives_it(pair):
    """One that does may abort the interpreter while it closes, after all the work is done."""
    threads = [(pair / f"threads-{rank}").read_text().split() for rank in (0, 1)]
    assert [name for each in threads for name in each if "gloo" in name] == []


def test_a_process_alone_takes_everything_and_exchanges_nothing(monkeypatch):
    monkeypatch.delenv("WORLD_SIZE", raising=False)
    with joined() as team:
        assert team == Team() == Team.current()
    assert (team.leads, team.part(6)) == (True, slice(0, 6))
    assert team.largest(1.0, 2.0) == [1.0, 2.0]
    assert team.means({"loss": 3.0}) == {"loss": 3.0}


def test_every_process_has_a_part_of_its_own():
    taken = [index for rank in range(3) for index in range(12)[Team(rank, 3).part(12)]]
    assert taken == list(range(12))


def test_more_processes_than_gpus_are_refused(monkeypatch):
    monkeypatch.setenv("WORLD_SIZE", "2")
    monkeypatch.setenv("LOCAL_RANK", "1")
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    with pytest.raises(ConfigError, match="--nproc-per-node"), joined():
        pass


@pytest.mark.parametrize(
    ("layer", "shape"),
    [(nn.BatchNorm1d(3, momentum=0.2), (7, 3)), (nn.BatchNorm2d(3), (2, 3, 4, 5))],
)
@pytest.mark.parametrize("training", [True, False])
def test_global_statistics_of_one_batch_are_those_of_the_plain_layer(
    monkeypatch, layer, shape, training
):
    monkeypatch.setattr(Total, "apply", lambda own: own)
    torch.manual_seed(0)
    layer.train(training).reset_running_stats()
    nn.init.normal_(layer.weight)
    twin = GlobalBatchNorm(layer)
    twin.running_mean, twin.running_var = layer.running_mean.clone(), layer.running_var.clone()
    values = (3 * torch.randn(shape) + 50).requires_grad_()
    again = values.detach().clone().requires_grad_()
    for each, given in ((layer, values), (twin, again)):
        each(given).square().mul(
            torch.arange(float(shape[0])).view(-1, *[1] * (len(shape) - 1))
        ).sum().backward()
    torch.testing.assert_close(values.grad, again.grad, rtol=1e-4, atol=1e-4)
    torch.testing.assert_close(twin.running_mean, layer.running_mean)
    torch.testing.assert_close(twin.running_var, layer.running_var)


def test_shared_statistics_keep_every_name_and_tensor():
    module = nn.Sequential(nn.Sequential(nn.Conv2d(2, 3, 1), nn.BatchNorm2d(3)), nn.BatchNorm2d(3))
    before = module.state_dict()
    share_statistics(module)
    assert isinstance(module[0][1], GlobalBatchNorm) and isinstance(module[1], GlobalBatchNorm)
    after = module.state_dict()
    assert before.keys() == after.keys()
    assert all(before[name].data_ptr() == after[name].data_ptr() for name in before)
