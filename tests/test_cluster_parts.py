"""What a cluster job is made of: places, runs, parcels, a worker's drawing; no process starts."""

import dataclasses
import json
import os
import signal
import sys
from pathlib import Path

import OpenImageIO as oiio  # noqa: N813 its own documentation's name
import pytest
import tiny_model
import torch
from command_line import run
from hypothesis import given
from hypothesis import strategies as st

from pe_runtime.cli.clusters import with_default_place
from pe_runtime.cluster import drawing
from pe_runtime.cluster.connection import Place, parse_place
from pe_runtime.cluster.drawing import Workplace, draw, versions
from pe_runtime.cluster.model_copies import file_digest, find_copy, keep_copy
from pe_runtime.cluster.parcels import (
    Answer,
    FrameOrder,
    Job,
    answer_as_dict,
    pack,
    read_answer,
    unpack,
)
from pe_runtime.cluster.runs import LONGEST, split_into_runs
from pe_runtime.contract.errors import ClusterError
from pe_runtime.contract.shot import Shot, Start
from pe_runtime.environment import PlayableEnvironment, find_model
from pe_runtime.shots import start_state
from pe_runtime.shots.clips import sample_clip, start_from_clip
from pe_runtime.state import EnvironmentState, ObjectState, state_as_dict


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return Path(tiny_model.write_model(tmp_path_factory.mktemp("model") / "tiny.safetensors"))


@pytest.fixture(autouse=True)
def threads_as_before():
    before = torch.get_num_threads()
    yield
    torch.set_num_threads(before)


def job(model, **changes):
    content = {
        "versions": versions(),
        "model": str(model),
        "model_digest": file_digest(model),
        "device": "cpu",
        "quality": "exact",
        "depth": True,
        "masks": ("player_1",),
    }
    return Job(**(content | changes))


def orders(count=3):
    torch.manual_seed(0)
    objects = {
        name: ObjectState(torch.tensor(place), torch.randn(4), torch.randn(3), heading=0.1)
        for name, place in tiny_model.PLACES.items()
    }
    objects["ground"] = ObjectState(torch.zeros(3), torch.randn(4), torch.zeros(0))
    state = EnvironmentState(objects)
    return [FrameOrder(n, f"digest {n}", state, tiny_model.camera(0.1 * n)) for n in range(count)]


@pytest.mark.parametrize("region", [None, (2, 1, 20, 12)])
def test_a_job_comes_back_with_its_region_layers_and_background(model, region):
    asked = job(model, region=region, layers=("player_2",), background=True)
    back, _ = unpack(pack(asked, orders(1)))
    assert back == asked
    for wish in ({"layers": ("player_1",)}, {"background": True}):
        passes = job(model, depth=False, masks=(), **wish)
        assert drawing.endings(passes) == (".exr", ".png")
    assert drawing.endings(job(model, depth=False, masks=())) == (".png",)


def test_a_worker_draws_the_region_and_the_layers_of_a_job(model, tmp_path):
    asked = job(model, region=(2, 1, 20, 12), layers=("player_2",), background=True)
    answer = draw(pack(asked, orders(1)), at(tmp_path))
    assert answer.problem == "", answer.problem
    (tmp_path / "0.exr").write_bytes(answer.drawn[0][".exr"])
    picture = oiio.ImageInput.open(str(tmp_path / "0.exr"))
    names, size = picture.spec().channelnames, (picture.spec().width, picture.spec().height)
    picture.close()
    assert size == (20, 12)
    assert {"layer.player_2.A", "background.R", "Z", "mask.player_1"} <= set(names)


def at(tmp_path, threads=1):
    return Workplace("tcp://worker:1", str(tmp_path), threads)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("local", Place()),
        ("local:4", Place(workers=4)),
        ("tcp://10.0.0.5:8786", Place("tcp://10.0.0.5:8786")),
        ("tls://farm-1.studio:8786", Place("tls://farm-1.studio:8786")),
        ("farm:8786", Place("farm:8786")),
        ("tcp://[::1]:8786", Place("tcp://[::1]:8786")),
    ],
)
def test_a_place_is_local_or_a_schedulers_address(text, place):
    assert parse_place(text) == place


@pytest.mark.parametrize(
    "text", ["", "local:", "local:0", "local:-1", "local:two", "locale", "10.0.0.5", "http://a:1"]
)
def test_what_is_no_place_is_refused_with_an_example(text):
    with pytest.raises(ClusterError, match=r"local:4.*tcp://10\.0\.0\.5:8786"):
        parse_place(text)


@pytest.mark.parametrize(
    ("given", "read"),
    [
        ("s.json -o out --cluster", "s.json -o out --cluster local"),
        ("s.json --cluster -o out", "s.json --cluster local -o out"),
        ("--cluster s.json -o out", "--cluster local s.json -o out"),
        ("s.json --cluster local:2 -o out", "s.json --cluster local:2 -o out"),
        ("s.json --cluster=tcp://a:1 -o out", "s.json --cluster=tcp://a:1 -o out"),
        ("s.json -o out", "s.json -o out"),
    ],
)
def test_the_option_may_stand_without_a_value(given, read):
    assert with_default_place(given.split()) == read.split()


def test_a_wrong_place_is_refused_before_the_model_is_loaded(capsys, tmp_path):
    code, _, err = run(capsys, "render", tmp_path / "no.json", "-o", tmp_path, "--cluster", "here")
    assert code == 1
    assert "'here'" in err


def test_without_dask_one_line_says_how_to_install_it(capsys, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    for name in [name for name in sys.modules if name.startswith("pe_runtime.cluster")]:
        monkeypatch.delitem(sys.modules, name)
    code, out, err = run(capsys, "render", tmp_path / "shot.json", "-o", tmp_path, "--cluster")
    assert (code, out, err.count("\n")) == (1, "", 1)
    assert "pip install 'playable-environments[cluster]'" in err


def test_ctrl_c_without_a_cluster_exits_as_with_one(capsys, model, tmp_path, monkeypatch):
    (tmp_path / "state.json").write_text(json.dumps(state_as_dict(orders(1)[0].state)))
    shot = Shot(1, str(model), Start(state="state.json"), 5.0, 1, 3, (tiny_model.camera(),) * 3)
    (tmp_path / "shot.json").write_text(shot.to_json())
    render = PlayableEnvironment.render

    def interrupted(*arguments):
        os.kill(os.getpid(), signal.SIGINT)
        return render(*arguments)

    monkeypatch.setattr(PlayableEnvironment, "render", interrupted)
    code, out, err = run(capsys, "render", tmp_path / "shot.json", "-o", tmp_path / "out")
    assert (code, out, err.count("\n")) == (130, "", 1)
    assert "cancelled after 1 of 3 frames" in err
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["0001.png"]


@given(st.sets(st.integers(0, 2000), max_size=600), st.integers(1, 40))
def test_runs_hold_every_frame_once_and_in_order(frames, workers):
    frames = sorted(frames)
    runs = list(split_into_runs(frames, workers))
    assert [number for run in runs for number in run] == frames
    assert all(0 < len(run) <= LONGEST for run in runs)
    # Whoever is done first finds something left to do, and little of it at the end.
    assert len(runs) >= min(len(frames), 3 * workers) // 2
    lengths = [len(run) for run in runs]
    assert lengths == sorted(lengths, reverse=True)
    assert not runs or lengths[-1] == 1


def test_a_parcel_brings_every_bit_of_a_frame(model):
    sent, wanted = job(model), orders()
    received, frames = unpack(pack(sent, wanted))
    assert received == sent
    for a, b in zip(frames, wanted, strict=True):
        assert (a.number, a.digest, a.camera) == (b.number, b.digest, b.camera)
        for name, each in b.state.objects.items():
            assert torch.equal(a.state[name].position, each.position)
            assert torch.equal(a.state[name].style, each.style)
            assert torch.equal(a.state[name].pose, each.pose)
            assert a.state[name].heading == each.heading


GOOD = Answer("w", {1: {".png": b"p"}}, 2, "why")


def test_an_answer_survives_being_sent():
    assert read_answer(answer_as_dict(GOOD), (1, 2), (".png",)) == GOOD


@pytest.mark.parametrize(
    "changes",
    [
        {"worker": 3},
        {"drawn": [1]},
        {"drawn": {3: {".png": b"p"}}},
        {"drawn": {1: {".png": "text"}}},
        {"drawn": {1: {".exr": b"p"}}},
        {"drawn": {1: {"/../0001.png": b"p"}}},
        {"failed": 7},
        {"problem": None},
        {"drawn": {}, "failed": None},
        {"drawn": {}, "failed": None, "needs_model": "yes"},
        {"surprise": 1},
    ],
    ids=str,
)
def test_an_answer_that_does_not_fit_its_run_is_refused(changes):
    with pytest.raises(ClusterError, match="frames 1-2"):
        read_answer(answer_as_dict(GOOD) | changes, (1, 2), (".png",))
    with pytest.raises(ClusterError, match="frames 1-2"):
        read_answer(None, (1, 2), (".png",))


def test_a_worker_draws_its_run_and_keeps_the_model(model, tmp_path, monkeypatch):
    loaded = []
    load = PlayableEnvironment.load
    monkeypatch.setattr(drawing, "_worlds", {})
    monkeypatch.setattr(PlayableEnvironment, "load", lambda *a: loaded.append(a) or load(*a))
    parcel = pack(job(model), orders())
    first, again = draw(parcel, at(tmp_path)), draw(parcel, at(tmp_path))
    assert first == again
    assert (first.worker, first.failed, first.problem) == ("tcp://worker:1", None, "")
    assert [set(files) for files in first.drawn.values()] == [{".exr", ".png"}] * 3
    assert first.drawn[0] != first.drawn[1]
    assert len(loaded) == 1


def test_when_its_time_is_up_a_worker_gives_back_the_frames_after_the_first(model, tmp_path):
    answer = draw(pack(job(model, seconds=0.0), orders()), at(tmp_path))
    assert (list(answer.drawn), answer.failed) == ([0], None)


def test_a_worker_names_the_frame_that_fails_and_keeps_those_before_it(model, tmp_path):
    wrong = orders()
    wrong[1] = dataclasses.replace(wrong[1], state=EnvironmentState({}))
    answer = draw(pack(job(model), wrong), at(tmp_path))
    assert (list(answer.drawn), answer.failed) == ([0], 1)
    assert answer.problem.startswith("ConfigError: ")


def test_a_worker_of_another_version_does_not_draw(model, tmp_path):
    foreign = job(model, versions=versions() | {"torch": "1.0", "its renderer": "0"})
    answer = draw(pack(foreign, orders()), at(tmp_path))
    assert (answer.drawn, answer.failed) == ({}, 0)
    assert f"torch {torch.__version__.partition('+')[0]} instead of 1.0" in answer.problem
    assert "its renderer" in answer.problem


def test_a_worker_uses_the_threads_that_the_job_or_else_dask_gives_it(model, tmp_path):
    draw(pack(job(model), orders(1)), at(tmp_path, threads=2))
    assert torch.get_num_threads() == 2
    draw(pack(job(model, threads=1), orders(1)), at(tmp_path, threads=2))
    assert torch.get_num_threads() == 1


@pytest.mark.parametrize("quality", ["exact", "draft"])
def test_a_frame_has_the_same_bytes_whatever_the_number_of_threads(tmp_path, monkeypatch, quality):
    model, start = find_model("duel"), start_from_clip(sample_clip("duel"))
    state = start_state(PlayableEnvironment.load(model, "cpu"), start)
    order = FrameOrder(1, "digest", state, start.camera)
    drawn = []
    for threads in (1, 2):
        monkeypatch.setattr(drawing, "_worlds", {})
        parcel = pack(job(model, quality=quality, threads=threads), [order])
        drawn.append(draw(parcel, at(tmp_path)).drawn[1])
        assert torch.get_num_threads() == threads
    assert drawn[0] == drawn[1]


def test_a_worker_takes_no_other_file_for_the_model(model, tmp_path, monkeypatch):
    monkeypatch.setattr(drawing, "_worlds", {})
    other = Path(tiny_model.write_model(tmp_path / "tiny.safetensors", seed=1))
    wanted = job(other, model_digest=file_digest(model))
    assert draw(pack(wanted, orders()), at(tmp_path)) == Answer("tcp://worker:1", needs_model=True)
    keep_copy(model.read_bytes(), file_digest(model), tmp_path)
    found = find_copy(wanted, tmp_path)
    assert file_digest(found) == file_digest(model)
    assert len(draw(pack(wanted, orders()), at(tmp_path)).drawn) == 3
