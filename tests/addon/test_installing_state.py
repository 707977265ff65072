"""Telling how a runtime is: in a Python that has it, has another one, has none, or is none."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from addon import running
from addon.stub_runtime import CARD, HELLO

import pe_runtime
from blender_addon.installing.processes import StoppedError, Watch, run
from blender_addon.installing.runtime_state import (
    BROKEN,
    MISSING,
    READY,
    WRONG_VERSION,
    check,
)
from blender_addon.worker.runtime_python import (
    CHOSEN,
    NO_RUNTIME,
    OWN,
    PRIVATE,
    VARIABLE,
    Places,
    RuntimePython,
    find_python,
    own_python,
    python_of,
    wanted_python,
)
from pe_runtime.contract.errors import WorkerError
from pe_runtime.contract.messages import PROTOCOL

GOOD = {
    "pe_runtime/__init__.py": f"__version__ = {pe_runtime.__version__!r}",
    "pe_runtime/contract/messages.py": f"PROTOCOL = {PROTOCOL}",
    "pe_runtime/worker/model_world.py": "import torch",
    "pe_runtime/worker/__main__.py": HELLO,
    "torch.py": CARD,
}


@pytest.fixture(scope="module")
def bare_python(tmp_path_factory):
    """An environment without anything, not even pip."""
    folder = tmp_path_factory.mktemp("bare")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    return folder


@pytest.fixture
def state_with(bare_python):
    """How a Python is said to be that has these files beside, or instead of, the good ones."""
    (packages,) = [*bare_python.glob("lib/*/site-packages"), *bare_python.glob("Lib/site-packages")]

    def state(changes=None, *arguments):
        for path in sorted(packages.rglob("*"), reverse=True):
            path.rmdir() if path.is_dir() else path.unlink()
        for name, text in (GOOD | (changes or {})).items():
            (packages / name).parent.mkdir(parents=True, exist_ok=True)
            if text is not None:
                (packages / name).write_text(text)
        return check(RuntimePython(str(python_of(bare_python)), CHOSEN), arguments)

    return state


def test_a_runtime_that_works_is_ready_with_its_version_and_its_card(state_with):
    state = state_with()
    assert (state.kind, state.version, state.device) == (READY, pe_runtime.__version__, "Card 0")
    assert state_with(None, "--device", "cpu").device == "CPU"


def test_a_python_without_the_runtime_is_told_from_no_python(state_with):
    state = state_with(dict.fromkeys(GOOD))
    assert (state.kind, bool(state.python)) == (MISSING, True)
    assert check(None).kind == MISSING and not check(None).python


@pytest.mark.parametrize(
    "changes",
    [
        {"pe_runtime/__init__.py": "__version__ = '0.0.1'"},
        {"pe_runtime/contract/messages.py": "PROTOCOL = 1"},
    ],
)
def test_another_version_or_another_build_is_a_wrong_version(state_with, changes):
    assert state_with(changes).kind == WRONG_VERSION


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"torch.py": None}, "No module named 'torch'"),
        ({"torch.py": "raise OSError('libtorch.so is not there')"}, "OSError: libtorch.so is not"),
        ({"torch.py": "import os\nos._exit(9)"}, "exit code 9"),
        ({"torch.py": "print('half a story', flush=True)\nimport os\nos._exit(9)"}, "half a story"),
        ({"pe_runtime/worker/__main__.py": "raise SystemExit('no, thanks')"}, "no, thanks"),
    ],
)
def test_a_runtime_that_cannot_start_says_why(state_with, changes, what):
    state = state_with(changes)
    assert state.kind == BROKEN and what in state.reason


def test_a_path_to_nothing_or_to_no_program_cannot_start(tmp_path):
    text = tmp_path / "notes.txt"
    text.write_text("no program")
    for path in (tmp_path / "nowhere", text):
        state = check(RuntimePython(str(path), CHOSEN))
        assert state.kind == BROKEN and path.name in state.reason


def test_a_check_can_be_stopped(state_with):
    with pytest.raises(StoppedError):
        check(RuntimePython(sys.executable, OWN), should_stop=lambda: True)


def test_the_real_runtime_is_ready():
    state = check(RuntimePython(sys.executable, OWN))
    assert (state.kind, state.version) == (READY, pe_runtime.__version__)
    assert check(RuntimePython(sys.executable, OWN), ["--fake"]).device == "fake"


def test_the_farms_word_goes_before_the_artists_and_that_before_ours(tmp_path):
    environment = tmp_path / "environment"
    environment.mkdir()
    (environment / "pyvenv.cfg").touch()
    places = Places("/chosen", environment, "/own")
    assert find_python(places, {VARIABLE: "/farm"}) == RuntimePython("/farm", VARIABLE)
    assert find_python(places, {}) == RuntimePython("/chosen", CHOSEN)
    found = find_python(Places("", environment, "/own"), {VARIABLE: ""})
    assert (found.python, found.origin) == (str(python_of(environment)), PRIVATE)
    assert find_python(Places("", tmp_path, "/own"), {}) == RuntimePython("/own", OWN)


def test_without_any_the_error_tells_every_way():
    assert find_python(Places(), {}) is None
    with pytest.raises(WorkerError) as caught:
        wanted_python(Places(), {})
    assert str(caught.value) == NO_RUNTIME
    assert all(way in NO_RUNTIME for way in ("Set Up Runtime", "preferences", VARIABLE))


def test_blenders_own_python_is_no_runtime_but_one_with_bpy_is(monkeypatch, tmp_path):
    assert own_python("/opt/blender/blender") == ""
    assert own_python("") == sys.executable
    # Only the contract, as the extension brings it along.
    monkeypatch.setattr(pe_runtime, "__file__", str(tmp_path / "__init__.py"))
    assert find_python(Places(own=sys.executable), {}) is None


def test_a_program_is_read_line_by_line_and_its_code_is_told():
    lines = []
    code = run(
        [sys.executable, "-c", "print('a'); print('ü'); raise SystemExit(5)"],
        Watch(on_line=lines.append),
    )
    assert (code, lines[0]) == (5, "a") and len(lines) == 2


def test_variables_of_blenders_python_are_kept_from_programs(monkeypatch):
    monkeypatch.setenv("PYTHONHOME", "/nowhere")
    monkeypatch.setenv("PIP_TARGET", "/elsewhere")
    lines = []
    program = "import os; print('PIP_TARGET' in os.environ, os.environ['KEPT'])"
    changes = {"PIP_TARGET": None, "KEPT": "yes"}
    assert run([sys.executable, "-c", program], Watch(on_line=lines.append), changes) == 0
    assert lines == ["False yes"]


@pytest.mark.skipif(os.name != "posix", reason="reads process states")
def test_stopping_a_program_ends_its_children_too(tmp_path):
    note = tmp_path / "child"
    program = (
        "import subprocess, sys, time; child = subprocess.Popen([sys.executable, '-c', "
        "'import time; time.sleep(60)']); "
        f"open({str(note)!r}, 'w').write(str(child.pid)); time.sleep(60)"
    )
    with pytest.raises(StoppedError):
        run([sys.executable, "-c", program], Watch(lambda: bool(_text(note))))
    child = int(_text(note))
    end = time.monotonic() + 60
    while child in running.commands() and time.monotonic() < end:
        time.sleep(0.05)
    assert child not in running.commands()


def _text(path: Path):
    return path.read_text() if path.is_file() else ""
