"""Whatever ends a job, at whatever moment: whole files, own settings, and the next job works."""

import errno
import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")
from blender_addon.filming.range_stop import stop_reasons  # noqa: E402 - after the check for Blender
from blender_addon.strips import lending, staging  # noqa: E402
from blender_addon.strips.job import job_for  # noqa: E402
from blender_addon.strips.placing import strips_of  # noqa: E402
from blender_addon.strips.running import run_job, time_left  # noqa: E402
from blender_addon.strips.whole_files import check_png  # noqa: E402
from pe_runtime.contract.errors import PlayableEnvironmentError, ShotError  # noqa: E402

pytestmark = pytest.mark.blender
COUNT, MOMENTS, SIZE = 12, 20, (64, 36)
PROCESS = [sys.executable, "-u", str(Path(__file__).with_name("render_process.py"))]
DEADLINE = 60.0


@pytest.fixture
def baked(environment):
    environment.frame_end = COUNT
    environment.render.filepath = "//mine"
    bpy.ops.playable.bake_paths()
    return environment


@pytest.fixture
def frames(tmp_path):
    return tmp_path / "frames"


def render(frames, **options):
    return bpy.ops.playable.render_to_sequencer(folder=str(frames), **options)


def whole_pictures(frames):
    """How many pictures there are; all of them whole, and nothing of a job's left beside them."""
    found = sorted(frames.glob("*.png"))
    for path in found:
        check_png(path.read_bytes(), SIZE, path)
    names = {path.name for path in frames.iterdir()} - {path.name for path in found}
    assert names <= {"playable_job.json"}
    return len(found)


def nothing_is_left(scene, frames):
    assert scene.render.filepath == "//mine" and scene.render.use_sequencer
    assert (scene.frame_start, scene.frame_end) == (1, COUNT)
    assert not any(map(lending.is_lent, bpy.data.scenes)) and not stop_reasons
    assert list(frames.parent.glob(f".*{staging.MARK}*")) == []


def strip_names(scene):
    edit = scene.playable_environment.edit_scene
    strips = strips_of(edit, scene.playable_environment.job) if edit else []
    return [[each.filename for each in strip.elements] for strip in strips]


def complete(scene, frames):
    assert render(frames) == {"FINISHED"}
    assert whole_pictures(frames) == COUNT
    assert strip_names(scene) == [[f"frame_{n:04d}.png" for n in range(1, COUNT + 1)]]


def test_a_worker_killed_at_any_moment_leaves_whole_files_and_the_next_job_works(
    baked, addon, frames
):
    complete(baked, frames)
    moments, failed = random.Random(5), 0
    for _ in range(MOMENTS):
        addon.facts("fake")
        killer = threading.Timer(moments.uniform(0.0, 0.12), _kill_worker, args=(addon,))
        killer.start()
        try:
            render(frames, everything=True)
        except RuntimeError as error:
            failed += 1
            assert "the worker ended" in str(error) or "cannot" in str(error)
        killer.join()
        assert whole_pictures(frames) == COUNT
        nothing_is_left(baked, frames)
    assert failed > 0
    complete(baked, frames)


def _kill_worker(addon):
    if addon.worker_pid:
        os.kill(addon.worker_pid, signal.SIGKILL)


FULL_DISK = """
import random, resource, sys
import bpy
sys.argv[1:] = ["", *sys.argv[1:]]
from addon import render_process, stage
import blender_addon
from blender_addon.worker.session import session
film, folder = sys.argv[2:]
blender_addon.register()
bpy.ops.wm.open_mainfile(filepath=film)
session.use_command(stage.FAKE)
session.facts("fake")
scene = bpy.context.scene
unlimited = resource.getrlimit(resource.RLIMIT_FSIZE)
moment, bytes_left = 0, 0
def fill(scene, *_):
    if scene.frame_current == moment:
        resource.setrlimit(resource.RLIMIT_FSIZE, (bytes_left, unlimited[1]))
bpy.app.handlers.render_write.append(fill)
chance = random.Random(3)
for _ in range(20):
    moment, bytes_left = chance.randrange(1, 12), chance.choice([0, 10, 100, 300])
    bpy.app.handlers.render_write[:] = [fill]
    try:
        bpy.ops.playable.render_to_sequencer(folder=folder, everything=True)
    except RuntimeError as error:
        text = str(error)
    else:
        text = "FINISHED"
    resource.setrlimit(resource.RLIMIT_FSIZE, unlimited)
    sys.stderr.write(f"outcome {moment} {text.strip()}\\n")
    assert scene.render.filepath == "//mine" and scene.render.use_sequencer
bpy.app.handlers.render_write[:] = []
assert bpy.ops.playable.render_to_sequencer(folder=folder) == {"FINISHED"}
sys.stderr.write("the next one works\\n")
session.close()
sys.stderr.flush()
import os
os._exit(0)
"""


@pytest.fixture
def film(baked, tmp_path):
    """The scene as a file, for another process."""
    path = tmp_path / "film.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    return path


def process_environment():
    tests = Path(__file__).parents[1]
    paths = [str(tests), str(tests.parent), os.environ.get("PYTHONPATH", "")]
    return os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}


def test_a_full_disk_ends_the_job_in_words_and_leaves_whole_files(film, frames):
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(film), str(frames)],
        env=process_environment(),
        capture_output=True,
        text=True,
        timeout=3 * DEADLINE,
    )
    outcomes = [line for line in done.stderr.splitlines() if line.startswith("outcome")]
    assert done.returncode == 0, done.stderr[-2000:]
    assert len(outcomes) == MOMENTS
    assert not any("FINISHED" in line for line in outcomes)
    told = [line for line in outcomes if "disk may be full" in line or "free some space" in line]
    assert len(told) == MOMENTS, outcomes
    assert "the next one works" in done.stderr
    assert whole_pictures(frames) == COUNT


@pytest.mark.slow
def test_blender_killed_at_any_moment_leaves_whole_files_and_the_next_job_works(
    baked, film, frames
):
    moments = random.Random(7)
    for _ in range(MOMENTS):
        process = subprocess.Popen(
            [*PROCESS, "for_ever", str(film), str(frames)],
            env=process_environment(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        while (line := process.stderr.readline()) != "ready\n":
            assert line, "the process ended early"
        time.sleep(moments.uniform(0.0, 0.4))
        process.kill()
        process.wait(DEADLINE)
        process.stderr.close()
        for path in frames.glob("*.png") if frames.is_dir() else ():
            check_png(path.read_bytes(), SIZE, path)
    complete(baked, frames)
    nothing_is_left(baked, frames)


def test_a_folder_that_cannot_be_written_at_any_moment_is_told_and_the_next_job_works(
    baked, frames, monkeypatch
):
    moments, replace = random.Random(2), Path.replace
    complete(baked, frames)
    for _ in range(MOMENTS):
        left = [moments.randrange(COUNT)]

        def refusing(path, target, left=left):
            left[0] -= 1
            if left[0] < 0:
                raise PermissionError(errno.EACCES, "Permission denied", str(target))
            return replace(path, target)

        with monkeypatch.context() as patch:
            patch.setattr(Path, "replace", refusing)
            with pytest.raises(RuntimeError, match="Permission denied"):
                render(frames, everything=True)
        assert whole_pictures(frames) == COUNT
        nothing_is_left(baked, frames)
    complete(baked, frames)


def test_a_folder_made_read_only_at_any_moment_is_told_and_the_next_job_works(baked, frames):
    complete(baked, frames)
    frames.chmod(0o555)
    if os.access(frames, os.W_OK):
        frames.chmod(0o755)
        pytest.skip("nothing is read-only for this user")
    moments = random.Random(4)
    for _ in range(MOMENTS):
        moment = moments.randrange(COUNT)  # 0: before anything is drawn
        frames.chmod(0o755 if moment else 0o555)

        def forbid(scene, *_, moment=moment):
            if scene.frame_current == moment:
                frames.chmod(0o555)

        bpy.app.handlers.render_write.append(forbid)
        try:
            with pytest.raises(RuntimeError, match="cannot .*Permission denied"):
                render(frames, everything=True)
        finally:
            bpy.app.handlers.render_write.remove(forbid)
            frames.chmod(0o755)
        assert whole_pictures(frames) == COUNT
        nothing_is_left(baked, frames)
    complete(baked, frames)


def in_a_window(_scene_name):
    """Blender renders behind; the test lets it."""
    return True


def job_of(scene, frames):
    return job_for(scene, str(frames))


def until_rendering(running):
    for progress in running:
        if progress.renders:
            return progress
        time.sleep(0.002)
    raise AssertionError("it never came to rendering")


def test_a_job_that_is_given_up_at_any_moment_gives_everything_back(baked, frames):
    moments = random.Random(9)
    for _ in range(MOMENTS):
        running = run_job(job_of(baked, frames), in_a_window, everything=True)
        for _ in range(moments.randrange(12)):
            next(running)
            time.sleep(0.002)
        running.close()
        nothing_is_left(baked, frames)
    complete(baked, frames)


def test_esc_while_blender_renders_keeps_what_is_finished_and_the_strip(baked, frames):
    complete(baked, frames)
    before = strip_names(baked)
    running = run_job(job_of(baked, frames), in_a_window, everything=True)
    assert until_rendering(running).text == f"Frame 1 of {COUNT}"
    assert lending.is_lent(baked) and baked.render.filepath != "//mine"
    # What Blender does before and after an Esc.
    bpy.ops.render.render(animation=True, scene=baked.name)
    outcome = _outcome(running)
    assert (outcome.drawn, outcome.stopped) == (COUNT, False)
    running = run_job(job_of(baked, frames), in_a_window, everything=True)
    until_rendering(running)
    for handler in list(bpy.app.handlers.render_cancel):
        handler(baked)
    outcome = _outcome(running)
    assert outcome.stopped and "which are kept; render again to go on" in outcome.in_words()
    assert strip_names(baked) == before
    nothing_is_left(baked, frames)
    complete(baked, frames)


def _outcome(running):
    try:
        for _ in range(1000):
            next(running)
            time.sleep(0.001)
    except StopIteration as end:
        return end.value
    raise AssertionError("it does not end")


def test_a_render_job_that_vanishes_without_a_word_is_over(baked, frames):
    running = run_job(job_of(baked, frames), in_a_window)
    until_rendering(running)
    assert _outcome(running).stopped
    nothing_is_left(baked, frames)


def test_a_scene_deleted_while_it_is_rendered_costs_nothing_but_the_job(baked, frames):
    bpy.data.scenes.new("another")
    running = run_job(job_of(baked, frames), in_a_window)
    until_rendering(running)
    bpy.data.scenes.remove(baked)
    with pytest.raises((PlayableEnvironmentError, StopIteration)):
        while True:
            next(running)
    assert not any(map(lending.is_lent, bpy.data.scenes)) and not stop_reasons
    assert whole_pictures(frames) == 0


def test_a_scene_deleted_while_it_is_read_is_told(baked, frames):
    bpy.data.scenes.new("another")
    baked.frame_end = 40
    bpy.ops.playable.bake_paths()
    running = run_job(job_of(baked, frames), in_a_window)
    next(running)
    bpy.data.scenes.remove(baked)
    with pytest.raises(ShotError, match="was deleted while its range was rendered"):
        while True:
            next(running)


def test_a_scene_renamed_while_it_is_rendered_is_found_again(baked, frames):
    running = run_job(job_of(baked, frames), in_a_window)
    next(running)
    baked.name = "renamed"
    until_rendering(running)
    bpy.ops.render.render(animation=True, scene=baked.name)
    assert _outcome(running).drawn == COUNT
    nothing_is_left(baked, frames)


@pytest.mark.parametrize(
    ("spent", "done", "count", "said"),
    [
        (3.0, 0, 10, ""),
        (5.0, 5, 10, ", about 5 s left"),
        (0.1, 9, 10, ", about 1 s left"),
        (600.0, 10, 20, ", about 10 min left"),
        (7200.0, 10, 30, ", about 4 h 00 min left"),
    ],
)
def test_the_time_that_is_left_is_said_in_the_unit_that_fits(spent, done, count, said):
    assert time_left(spent, done, count) == said
