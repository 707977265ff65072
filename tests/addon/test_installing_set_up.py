"""Setting up the runtime for real: environments, pip and a worker, but light ones, offline."""

import os
import random
import sys
import threading
import time

import pytest
from addon import running
from addon.stub_runtime import plan_for, write_wheels

from blender_addon.installing import set_up as building
from blender_addon.installing.folder_lock import folder_lock
from blender_addon.installing.plan import COSTS, CPU, GPU, Cost, SetUpError
from blender_addon.installing.processes import StoppedError
from blender_addon.installing.runtime_state import READY
from blender_addon.installing.set_up import INSTALLED, LOG, remove, set_up
from blender_addon.worker.runtime_python import CHOSEN, RuntimePython

PYTHON = sys.executable


def never():
    return False


def nobody(_stage, _share):
    pass


def read(path):
    return path.read_text()


@pytest.fixture
def wheel(tmp_path):
    return write_wheels(tmp_path / "wheels of 猫")


@pytest.fixture
def plan(tmp_path, wheel):
    """Into a folder whose name has a space and letters of several alphabets."""
    return plan_for(PYTHON, wheel, tmp_path / "Anna Müller 猫" / "runtime")


@pytest.fixture
def old(plan):
    """A runtime that was set up before: a folder to be recognised again."""
    plan.environment.mkdir(parents=True)
    (plan.environment / "pyvenv.cfg").write_text("the old one")
    return plan.environment / "pyvenv.cfg"


def left_behind(plan):
    """Folders that should be gone, and programs that should have ended."""
    folders = [path.name for path in plan.folder.iterdir() if path.name[-1:] != "k"]
    known = {plan.environment.name, LOG}
    return sorted(set(folders) - known), running.mentioning(str(plan.folder))


def test_a_runtime_is_set_up_and_takes_the_place_of_one_whose_worker_has_ended(plan, old):
    stages, seen = [], []
    state = set_up(plan, never, lambda *each: stages.append(each), lambda: seen.append(read(old)))
    assert seen == ["the old one"] and read(old) != "the old one"
    assert (state.kind, state.device) == (READY, "Card 0")
    assert state.python.startswith(str(plan.environment))
    assert building.check(RuntimePython(state.python, CHOSEN)).kind == READY
    assert left_behind(plan) == ([], [])
    shares = [share for _, share in stages]
    assert shares == sorted(shares) and (shares[0], shares[-1]) == (0.0, 1.0)
    names = [stage for stage, _ in stages]
    assert "Unpacking 2 packages" in names and names[0] == "Making an environment"


def test_a_package_that_cannot_be_had_leaves_the_old_runtime_and_says_which(tmp_path, plan, old):
    lacking = write_wheels(tmp_path / "lacking", torch="1.2.3")
    with pytest.raises(SetUpError, match=r"installing the packages failed .*torch=="):
        set_up(plan_for(PYTHON, lacking, plan.folder), never, nobody)
    assert old.read_text() == "the old one"
    assert left_behind(plan) == ([], [])
    assert "torch==1.2.3" in (plan.folder / LOG).read_text()


def test_a_runtime_that_does_not_answer_never_replaces_one_that_does(tmp_path, plan, old):
    broken = write_wheels(tmp_path / "broken", {"pe_runtime/worker/__main__.py": "raise OSError"})
    with pytest.raises(SetUpError, match="the new runtime does not work: the worker ended"):
        set_up(plan_for(PYTHON, broken, plan.folder), never, nobody)
    assert old.read_text() == "the old one"
    assert left_behind(plan) == ([], [])


def stop_after(seconds):
    end = time.monotonic() + seconds
    return lambda: time.monotonic() > end


@pytest.mark.parametrize("wanted", [0.0, 0.3, INSTALLED])
def test_stopping_at_any_stage_leaves_nothing(plan, old, wanted):
    seen = []
    with pytest.raises(StoppedError):
        set_up(
            plan,
            lambda: any(share >= wanted for share in seen),
            lambda _stage, share: seen.append(share),
        )
    assert old.read_text() == "the old one"
    assert left_behind(plan) == ([], [])


@pytest.mark.slow
def test_stopping_at_twenty_random_moments_leaves_nothing_or_a_runtime_that_works(plan, old):
    chance, ended = random.Random(0), []
    for _ in range(20):
        try:
            ended.append(set_up(plan, stop_after(chance.uniform(0, 8)), nobody).kind)
        except StoppedError:
            ended.append("stopped")
            assert old.read_text() == "the old one" or READY in ended
        assert left_behind(plan) == ([], [])
    assert "stopped" in ended


def test_a_folder_that_cannot_be_written_to_is_named(tmp_path, wheel):
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    with pytest.raises(SetUpError, match="cannot be set up: .*file"):
        set_up(plan_for(PYTHON, wheel, blocked / "runtime"), never, nobody)


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may write anywhere")
def test_a_read_only_folder_is_named(tmp_path, wheel):
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o500)
    with pytest.raises(SetUpError, match="cannot be set up: .*locked"):
        set_up(plan_for(PYTHON, wheel, locked / "runtime"), never, nobody)


def test_a_disk_without_room_is_told_before_anything_begins(plan, monkeypatch):
    monkeypatch.setitem(COSTS, CPU, Cost(10**18, 10**18))
    with pytest.raises(SetUpError, match=r"1000000000.0 GB of disk, .* GB are free"):
        set_up(plan, never, nobody)
    assert left_behind(plan) == ([], [])


def test_two_blenders_do_not_set_up_in_one_folder_at_once(plan):
    with folder_lock(plan.folder), pytest.raises(SetUpError, match="another Blender works in"):
        set_up(plan, never, nobody)


def test_what_a_killed_blender_left_is_swept_away(plan, tmp_path):
    (plan.folder / "building-abc" / "environment").mkdir(parents=True)
    (plan.folder / "removing-1").mkdir()
    with pytest.raises(StoppedError):
        set_up(plan, lambda: True, nobody)
    assert left_behind(plan) == ([], [])


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("#!/bin/sh\necho 3 9\n", "expected a Python 3.11 to 3.14, found 3.9"),
        ("#!/bin/sh\necho 3 99\n", "found 3.99"),
        ("#!/bin/sh\necho I am no snake\n", "found none: it says 'I am no snake'"),
        ("#!/bin/sh\necho broken >&2\nexit 3\n", r"starting Python failed \(exit code 3\)"),
    ],
)
@pytest.mark.skipif(os.name != "posix", reason="the stand-ins are shell scripts")
def test_a_python_that_does_not_fit_is_refused_first(tmp_path, wheel, text, what):
    stand_in = tmp_path / "python"
    stand_in.write_text(text)
    stand_in.chmod(0o755)
    with pytest.raises(SetUpError, match=what):
        set_up(plan_for(str(stand_in), wheel, tmp_path / "runtime"), never, nobody)


@pytest.mark.skipif(os.name != "posix", reason="the stand-in is a shell script")
def test_a_python_that_cannot_make_environments_says_what_it_lacks(tmp_path, wheel):
    stand_in = tmp_path / "python"
    stand_in.write_text(
        '#!/bin/sh\ncase "$*" in *venv*) echo because ensurepip is not; exit 1;; esac\necho 3 12\n'
    )
    stand_in.chmod(0o755)
    with pytest.raises(SetUpError, match=r"install python3-venv .*, or choose another Python"):
        set_up(plan_for(str(stand_in), wheel, tmp_path / "runtime"), never, nobody)


def test_a_python_that_is_not_there_is_named(tmp_path, wheel):
    with pytest.raises(SetUpError, match=r"no_such_python.* cannot start"):
        set_up(plan_for("/no_such_python", wheel, tmp_path / "runtime"), never, nobody)


@pytest.mark.slow
def test_torch_for_the_card_comes_from_the_plain_index_on_linux(tmp_path, plan):
    plain = write_wheels(tmp_path / "plain", build="")
    wanted = plan_for(PYTHON, plain, plan.folder, GPU)
    assert set_up(wanted, never, nobody).kind == READY


def test_removing_leaves_no_trace_of_the_runtime(plan, old):
    (plan.folder / "building-abc").mkdir()
    remove(plan.folder)
    assert not plan.environment.exists() and left_behind(plan) == ([], [])
    remove(plan.folder)


def test_a_swap_that_fails_brings_the_old_runtime_back(plan, old, monkeypatch, tmp_path):
    monkeypatch.setattr(building, "TRIES", 1)
    with pytest.raises(OSError, match="nowhere"):
        building._replace(tmp_path / "nowhere", plan.environment)
    assert old.read_text() == "the old one"


def test_a_lock_is_free_again_when_its_holder_is_done(plan):
    for _ in range(2):
        with folder_lock(plan.folder):
            pass
    assert threading.active_count() < 50
