"""Shots drawn by real Dask workers: the same bytes, whatever happens to the workers."""

import dataclasses
import json
import logging
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import dask
import psutil
import pytest
import tiny_model
from distributed import Client, LocalCluster

from pe_runtime.cluster import spreading
from pe_runtime.cluster.connection import CLOSED_DOORS, Place
from pe_runtime.cluster.spreading import ModelFile, draw_on_cluster
from pe_runtime.contract.errors import ClusterError
from pe_runtime.contract.shot import ObjectTrack, Shot, Start
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.shots import RenderCancelledError, render_shot
from pe_runtime.shots.files import plan_frames

ROOT = Path(__file__).parents[1]
WORKERS = 3
QUIET = {
    "threads_per_worker": 1,
    "dashboard_address": None,
    "scheduler_kwargs": {"dashboard": False, "dashboard_address": "127.0.0.1:0"},
    "silence_logs": logging.CRITICAL,
}


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return Path(tiny_model.write_model(tmp_path_factory.mktemp("model") / "tiny.safetensors"))


@pytest.fixture(scope="module")
def world(model):
    return PlayableEnvironment.load(model, "cpu")


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    return tiny_model.write_clip(tmp_path_factory.mktemp("clip"))


@pytest.fixture(scope="module")
def client():
    """Three worker processes, their scheduler, and a connection of the test's own."""
    with (
        dask.config.set(CLOSED_DOORS),
        LocalCluster(n_workers=WORKERS, **QUIET) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        yield client


@pytest.fixture
def workers(client):
    """The three workers, all there and as they were."""
    client.wait_for_workers(WORKERS, timeout=60)
    yield Place(client.scheduler.address)
    client.run(mend)


@pytest.fixture(scope="module")
def shot(model, clip):
    return make_shot(model, clip)


def make_shot(model, clip, frames=24, size=(96, 48), **changes):
    start = Start(str(clip / "00000/frames/0/0000.png"), tiny_model.camera(), tiny_model.boxes())
    content = {
        "version": 1,
        "model": str(model),
        "start": start,
        "fps": 10.0,
        "frame_start": 1,
        "frame_end": frames,
        "cameras": tuple(tiny_model.camera(0.01 * i, *size) for i in range(frames)),
        "objects": (ObjectTrack("player_1", ((1, 1), (9, 2))),),
        "passes": ("depth", "mask:player_1"),
    }
    return Shot(**(content | changes))


def spoil(fault, number=0, folder=""):
    """Give a worker a fault that shows where it writes a frame; runs in the worker."""
    import os
    import time
    from pathlib import Path

    from pe_runtime.cluster import drawing

    drawing.honest = getattr(drawing, "honest", drawing.write_frame)

    def fails(frame):
        if fault == "twice" and frame == number and len(list(Path(folder).iterdir())) < 2:
            (Path(folder) / str(os.getpid())).touch()
            return True
        return fault == "always" and frame == number

    def write_frame(place, frame, *rest):
        if fault == "slow":
            time.sleep(0.05)
        if fault == "ends" and frame == number:
            os._exit(1)
        if fails(frame):
            raise OSError("no space left")
        drawing.honest(place, frame, *rest)

    drawing.write_frame = write_frame


def mend():
    """Undo `spoil`; runs in the worker."""
    from pe_runtime.cluster import drawing

    drawing.write_frame = getattr(drawing, "honest", drawing.write_frame)


def pids(client):
    return client.run(os.getpid).values()


def contents(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def draw(world, shot, workers, folder, **how):
    plan = plan_frames(world, shot, folder, how.pop("frames", None), how.pop("resume", True))
    model = ModelFile(how.pop("model", Path(shot.model)), "cpu")
    return draw_on_cluster(workers, plan, model, **how)


def suspicions(client):
    """How often a worker went away with a run of ours."""

    def count(dask_scheduler):
        prefixes = dask_scheduler.task_prefixes
        return prefixes["draw"].suspicious if "draw" in prefixes else 0

    return client.run_on_scheduler(count)


def test_of_three_workers_one_is_killed_and_every_frame_arrives_byte_for_byte(
    client, workers, world, model, clip, tmp_path
):
    shot = make_shot(model, clip, frames=36)
    client.run(spoil, "slow")
    before, progress = client.run(os.getpid), []

    def kill_one(done, total):
        progress.append((done, total))
        if done == 1:
            victim = next(each for each, tasks in client.processing().items() if tasks)
            os.kill(before[victim], signal.SIGKILL)

    report = draw(world, shot, workers, tmp_path / "cluster", on_progress=kill_one)
    assert suspicions(client) >= 1, "the killed worker had no run in hand"
    assert (report.written, report.kept) == (tuple(shot.frames), ())
    assert progress == [(done, 36) for done in range(1, 37)]
    client.wait_for_workers(WORKERS, timeout=60)
    assert len(set(pids(client)) & set(before.values())) == WORKERS - 1
    render_shot(world, shot, tmp_path / "alone")
    assert len(contents(tmp_path / "alone")) == 2 * 36
    assert contents(tmp_path / "cluster") == contents(tmp_path / "alone")


def test_only_frames_that_are_not_yet_right_are_sent(workers, world, shot, tmp_path):
    render_shot(world, shot, tmp_path, frames=range(3, 9))
    (tmp_path / "0004.png").write_bytes(b"torn")
    progress = []
    report = draw(
        world,
        shot,
        workers,
        tmp_path,
        frames=range(1, 9),
        on_progress=lambda *a: progress.append(a),
    )
    assert (report.written, report.kept) == ((1, 2, 4), (3, 5, 6, 7, 8))
    assert progress == [(6, 8), (7, 8), (8, 8)]


def test_when_nothing_is_missing_no_cluster_is_sought(world, shot, tmp_path):
    render_shot(world, shot, tmp_path, frames=[1])
    report = draw(world, shot, Place("tcp://127.0.0.1:1"), tmp_path, frames=[1])
    assert report.kept == (1,)


def test_a_frame_that_fails_is_tried_on_other_workers(client, workers, world, shot, tmp_path):
    tried = tmp_path / "tried"
    tried.mkdir()
    client.run(spoil, "twice", 5, str(tried))
    assert draw(world, shot, workers, tmp_path / "out").written == tuple(shot.frames)
    assert len({path.name for path in tried.iterdir()} & set(map(str, pids(client)))) == 2


def test_a_frame_that_fails_everywhere_is_named_once_and_the_others_stay(
    client, workers, world, shot, tmp_path
):
    client.run(spoil, "always", 5)
    with pytest.raises(ClusterError, match=r"frame 5 .*OSError: no space left") as failure:
        draw(world, shot, workers, tmp_path)
    assert len(set(client.nthreads()) & set(str(failure.value).replace(",", "").split())) >= 2
    assert not (tmp_path / "0005.png").exists()
    there = {path.name for path in tmp_path.iterdir()}
    client.run(mend)
    report = draw(world, shot, workers, tmp_path)
    assert 5 in report.written
    assert len(report.kept) >= len(there) // 2 > 0


def test_a_frame_that_ends_its_workers_is_named(client, workers, world, shot, tmp_path):
    def allow(failures, dask_scheduler):
        dask_scheduler.allowed_failures = failures

    client.run_on_scheduler(allow, 0)
    client.run(spoil, "ends", 5)
    try:
        with pytest.raises(ClusterError, match=r"frame 5 ended one worker process after the other"):
            draw(world, shot, workers, tmp_path, frames=range(2, 9))
    finally:
        client.run_on_scheduler(allow, 3)
    # Those that were with the same workers are not blamed: 5 was tried with nothing else around.
    assert {f"{n:04d}.png" for n in (2, 3)} <= set(contents(tmp_path))


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="needs a path of one process only")
def test_a_model_that_the_workers_cannot_read_is_sent_to_them_once(
    client, workers, clip, tmp_path, monkeypatch
):
    model = Path(tiny_model.write_model(tmp_path / "other.safetensors", seed=3))
    world, shot = PlayableEnvironment.load(model, "cpu"), make_shot(model, clip)
    sent = []
    register = Client.register_plugin
    monkeypatch.setattr(
        Client, "register_plugin", lambda *each: sent.append(each) or register(*each)
    )
    with model.open("rb") as file:
        own = Path(f"/proc/self/fd/{file.fileno()}")
        draw(world, shot, workers, tmp_path / "cluster", model=own)
    assert len(sent) == 1
    render_shot(world, shot, tmp_path / "alone")
    assert contents(tmp_path / "cluster") == contents(tmp_path / "alone")

    def copies(dask_worker):
        return [str(path) for path in Path(dask_worker.local_directory).glob("model-*")]

    assert list(client.run(copies).values()) == [[]] * WORKERS


def test_a_job_that_is_cancelled_keeps_its_frames_and_leaves_nothing_behind(
    client, workers, world, shot, tmp_path
):
    done = []
    with pytest.raises(RenderCancelledError, match=r"cancelled after \d+ of 24 frames"):
        draw(
            world,
            shot,
            workers,
            tmp_path,
            on_progress=lambda *each: done.append(each),
            should_stop=lambda: len(done) >= 2,
        )
    assert 2 <= len(list(tmp_path.glob("*.png"))) == len(done) < 24
    assert not list(tmp_path.glob(".*"))

    def tasks(dask_scheduler):
        return [key for key in dask_scheduler.tasks if str(key).startswith("draw")]

    assert client.run_on_scheduler(tasks) == []
    assert len(draw(world, shot, workers, tmp_path).kept) == len(done)


def test_an_address_without_a_scheduler_is_an_error_that_says_how_to_start_one(
    world, shot, tmp_path, monkeypatch
):
    monkeypatch.setattr("pe_runtime.cluster.connection.CONNECT_SECONDS", 0.5)
    with pytest.raises(ClusterError, match="tcp://127.0.0.1:1 .*dask scheduler"):
        draw(world, shot, Place("tcp://127.0.0.1:1"), tmp_path)


def test_a_cluster_without_workers_or_that_goes_away_is_an_error(
    world, shot, tmp_path, monkeypatch
):
    monkeypatch.setattr(spreading, "LONELY_SECONDS", 0.3)
    with (
        dask.config.set(CLOSED_DOORS),
        LocalCluster(n_workers=0, **QUIET) as cluster,
    ):
        with pytest.raises(ClusterError, match="no worker at tcp://.*dask worker"):
            draw(world, shot, Place(cluster.scheduler_address), tmp_path)
        monkeypatch.setattr(spreading, "LONELY_SECONDS", 60.0)
        asked = []

        def leave():
            asked.append(1)
            if len(asked) == 1:
                cluster.close()
            return False

        with pytest.raises(ClusterError, match="went away"):
            draw(world, shot, Place(cluster.scheduler_address), tmp_path, should_stop=leave)


def test_ctrl_c_at_the_terminal_ends_all_processes_and_keeps_what_is_drawn(
    world, model, clip, tmp_path
):
    shot = make_shot(model, clip, frames=500, size=(192, 96), passes=())
    (tmp_path / "shot.json").write_text(shot.to_json())
    out = tmp_path / "out"
    words = ("render", tmp_path / "shot.json", "-o", out, "--cluster", "local:2", "--device", "cpu")
    command = [sys.executable, "-m", "pe_runtime.cli", *map(str, words)]
    process = subprocess.Popen(
        command, cwd=ROOT, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    while process.poll() is None and not list(out.glob("0*.png")):
        time.sleep(0.05)
    helpers = psutil.Process(process.pid).children(recursive=True)
    # As a terminal does: to the whole group.
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=120)
    assert (process.returncode, said.count("\n")) == (130, 1), said
    assert "of 500 frames" in said
    assert psutil.wait_procs(helpers, timeout=10)[1] == []
    drawn = sorted(int(path.stem) for path in out.glob("*.png"))
    assert 0 < len(drawn) < 500
    assert render_shot(world, shot, out, frames=drawn).written == ()


def test_render_on_a_local_cluster_says_what_it_drew(model, clip, tmp_path, capsys):
    from command_line import result

    shot = dataclasses.replace(make_shot(model, clip, frames=3), passes=())
    (tmp_path / "shot.json").write_text(shot.to_json())
    words = ("render", tmp_path / "shot.json", "-o", tmp_path / "out", "--cluster", "local:1")
    assert result(capsys, *words)["written"] == [1, 2, 3]
    assert json.loads((tmp_path / "shot.json").read_text())["frame_end"] == 3
