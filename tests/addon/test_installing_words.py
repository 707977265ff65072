"""What is said about the runtime, and what a plan asks for, without doing any of it."""

from pathlib import Path

import pytest
from addon.stub_runtime import write_wheels

import pe_runtime
from blender_addon.installing.pip_progress import DOWNLOADED, PipProgress
from blender_addon.installing.plan import (
    CPU,
    GPU,
    SetUpError,
    SetUpPlan,
    base_python,
    bundled_wheel,
    pinned_torch,
)
from blender_addon.installing.runtime_state import (
    BROKEN,
    CHECKING,
    MISSING,
    READY,
    UNKNOWN,
    WRONG_VERSION,
    RuntimeState,
)
from blender_addon.installing.set_up import telling_lines
from blender_addon.installing.words import (
    ALLOW_ONLINE,
    LINE_CHARACTERS,
    NO_WHEEL,
    SETTING_UP,
    STARTED_OFFLINE,
    processor_hint,
    question_lines,
    refusal,
    size_in_words,
    words_of,
    worker_words,
)
from blender_addon.worker.runtime_python import CHOSEN, VARIABLE


@pytest.fixture
def plan(tmp_path):
    wheel = write_wheels(tmp_path / "runtime", torch="2.13.0")
    return lambda system, processor: SetUpPlan("/py", wheel, Path("/kept"), processor, system)


@pytest.mark.parametrize(
    ("state", "title", "line"),
    [
        (RuntimeState(UNKNOWN), "Not checked yet", ""),
        (RuntimeState(CHECKING), "Checking the runtime", ""),
        (
            RuntimeState(READY, "/p", CHOSEN, "1.2", "CPU"),
            "Ready: version 1.2 on CPU",
            "/p (chosen",
        ),
        (RuntimeState(MISSING), "No runtime yet", "Set Up Runtime"),
        (RuntimeState(MISSING, "/p"), "There is no runtime in this Python", "another Python"),
        (
            RuntimeState(WRONG_VERSION, "/p", VARIABLE, "0.0.1"),
            f"Wrong version: the runtime is 0.0.1, this add-on needs {pe_runtime.__version__}",
            VARIABLE,
        ),
        (
            RuntimeState(WRONG_VERSION, "/p", "", pe_runtime.__version__),
            "Wrong version: the runtime is another build",
            "Set Up Runtime",
        ),
        (RuntimeState(BROKEN, "/p", reason="libx is lost"), "cannot start", "libx is lost"),
    ],
)
def test_every_state_has_words_and_advice(state, title, line):
    words = words_of(state)
    assert title in words.title and line in " ".join(words.lines)
    assert all(len(each) <= LINE_CHARACTERS for each in words.lines)


def test_the_question_names_folder_size_and_sources(plan):
    said = "\n".join(question_lines(plan("linux", CPU)))
    assert "/kept/environment" in said and "330 MB" in said and "1.8 GB" in said
    assert "from pypi.org and download.pytorch.org" in said and "/py" in said
    assert "from pypi.org\n" in "\n".join(question_lines(plan("darwin", CPU)))
    assert "1.5 GB" in "\n".join(question_lines(plan("linux", GPU)))
    assert processor_hint(plan("linux", CPU)) and not processor_hint(plan("darwin", CPU))


def test_sizes_are_said_as_people_say_them():
    assert [size_in_words(n) for n in (9_000_000, 2 * 10**9, 1_500_000_000)] == [
        "9 MB",
        "2 GB",
        "1.5 GB",
    ]


@pytest.mark.parametrize(
    ("facts", "why"),
    [
        ((True, False, True, False), ""),
        ((False, False, True, False), ALLOW_ONLINE),
        ((False, True, True, False), STARTED_OFFLINE),
        ((True, False, False, False), NO_WHEEL),
        ((True, False, True, True), SETTING_UP),
    ],
)
def test_a_refusal_says_what_would_allow_it(facts, why):
    assert refusal(*facts) == why


@pytest.mark.parametrize(
    ("system", "processor", "torch", "index"),
    [
        ("linux", CPU, "torch==2.13.0+cpu", "https://download.pytorch.org/whl/cpu"),
        ("linux", GPU, None, None),
        ("win32", CPU, None, None),
        ("win32", GPU, "torch==2.13.0+cu130", "https://download.pytorch.org/whl/cu130"),
        ("darwin", CPU, None, None),
    ],
)
def test_torch_comes_from_where_its_build_for_the_processor_is(
    plan, system, processor, torch, index
):
    arguments = plan(system, processor).pip_arguments()
    named = [each for each in arguments if each.startswith("torch==")]
    indexes = [each for each in arguments if each.startswith("https://")]
    assert named == ([torch] if torch else []) and indexes == ([index] if index else [])
    assert arguments[0] == "install" and "--no-input" in arguments


def test_a_wheel_that_is_none_is_named(tmp_path):
    broken = tmp_path / "playable_environments-1-py3-none-any.whl"
    broken.write_text("no zip")
    with pytest.raises(SetUpError, match="is no wheel of the runtime"):
        pinned_torch(broken)
    assert bundled_wheel(tmp_path) is None
    assert bundled_wheel(write_wheels(tmp_path / "runtime").parents[1]) is not None


def test_a_python_is_found_also_where_blender_names_itself(tmp_path):
    assert base_python("/usr/bin/python3.14", "/usr") == "/usr/bin/python3.14"
    assert base_python("/blender", str(tmp_path)) == ""
    for name, system in (("bin/python3", "linux"), ("bin/python.exe", "win32")):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
        assert base_python("/blender", str(tmp_path), system) == str(tmp_path / name)


def test_progress_goes_from_looking_through_downloads_to_unpacking(tmp_path, monkeypatch):
    monkeypatch.setattr("blender_addon.installing.pip_progress.PAUSE_SECONDS", -1.0)
    downloads, packages = tmp_path / "downloads", tmp_path / "packages"
    downloads.mkdir()
    packages.mkdir()
    progress = PipProgress(downloads, lambda: packages, 1000)
    progress.note_line("Collecting torch==2.13.0")
    progress.look()
    assert (progress.stage, progress.share) == ("Looking for packages", 0.0)
    progress.note_line("  Downloading opencv_contrib-4.11-cp37-abi3-x.whl (56.1 MB)")
    (downloads / "part").write_bytes(b"x" * 500)
    progress.look()
    assert progress.stage == "Downloading opencv-contrib, 56.1 MB"
    assert progress.share == pytest.approx(DOWNLOADED / 2)
    (downloads / "part").unlink()
    progress.look()
    assert progress.share == pytest.approx(DOWNLOADED / 2)
    progress.note_line("Installing collected packages: mpmath, torch")
    assert progress.stage == "Unpacking 2 packages"
    for name in ("mpmath-1.dist-info", "torch-2.dist-info", "pip-3.dist-info"):
        (packages / name).mkdir()
    progress.look()
    assert progress.share == 1.0


def test_of_a_log_its_errors_are_told_or_else_its_end():
    log = ["$ pip install", "Collecting a", "ERROR: no wheel", "note: this is"]
    assert telling_lines(log) == "ERROR: no wheel"
    assert telling_lines(["$ pip", "one", "", "two"]) == "one / two"
    assert telling_lines([]) == "it said nothing"


@pytest.mark.parametrize(
    ("worker", "title"),
    [
        (("stopped", "", "", ""), "Starts when it is needed"),
        (("starting", "Loading the model", "", ""), "Loading the model"),
        (("starting", "", "", ""), "Starting"),
        (("busy", "", "cpu", ""), "Drawing"),
        (("ready", "", "cpu", ""), "Ready on cpu"),
        (("ready", "", "", ""), "Ready"),
        (("failed", "", "", "out of memory\nmore"), "The worker failed"),
    ],
)
def test_the_worker_has_words_for_all_it_does(worker, title):
    words = worker_words(*worker)
    assert words.title == title
    assert "more" not in " ".join(words.lines)
