"""The command line as its user meets it: exit codes, one line on stderr, results on stdout."""

import json
import os
import subprocess
import sys
import zipfile
from contextvars import ContextVar
from pathlib import Path

import pytest
import tiny_model
from command_line import result, run

from pe_runtime.benchmark.tables import Sheet, as_table
from pe_runtime.cli import terminal
from pe_runtime.cli.terminal import parse_frames, parse_size
from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.shot import ObjectTrack, Shot, Start

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return tiny_model.write_model(tmp_path_factory.mktemp("model") / "tiny.safetensors")


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    return tiny_model.write_clip(tmp_path_factory.mktemp("clip"))


@pytest.fixture
def encoded(capsys, model, clip, tmp_path):
    """A state file made by `pe encode`."""
    camera, boxes = tmp_path / "camera.json", tmp_path / "boxes.json"
    camera.write_text(json.dumps(tiny_model.camera().as_dict()))
    boxes.write_text(json.dumps(tiny_model.boxes()))
    picture, state = clip / "00000/frames/0/0000.png", tmp_path / "made" / "state.json"
    options = ("--camera", camera, "--boxes", boxes, "-o", state, "--model", model)
    found = result(capsys, "encode", picture, *options)
    return state, found["positions"]


def test_help_lists_every_command_of_the_design(capsys):
    code, out, _ = run(capsys, "--help")
    assert code == 0
    for name in ("demo", "info", "encode", "play", "render", "dataset", "train", "evaluate"):
        assert name in out
    for arguments in (("dataset", "--help"), ("train", "--help"), ("extension", "build", "--help")):
        assert run(capsys, *arguments)[0] == 0


def test_wrong_usage_exits_with_two_and_says_what_is_missing(capsys):
    for arguments, named in [
        (("render",), "shot"),
        (("nonsense",), "nonsense"),
        (("dataset", "record", "-o", "x", "--sequences", "0"), "sequences"),
        (("dataset", "record", "-o", "x", "--sequences", "1", "--size", "big"), "256x144"),
    ]:
        code, out, err = run(capsys, *arguments)
        assert (code, out) == (2, "")
        assert named in err


def test_an_unknown_model_is_one_line_on_stderr_and_exit_code_one(capsys):
    code, out, err = run(capsys, "info", "dual")
    assert (code, out) == (1, "")
    assert err.startswith("pe: ")
    assert "'dual'" in err
    assert err.count("\n") == 1


def test_info_tells_objects_and_actions_in_words_and_as_json(capsys, model):
    facts = result(capsys, "info", model)
    assert facts["actions"]["player_2"] == list(tiny_model.ACTIONS)
    assert facts["size"] == "32x16"
    code, out, _ = run(capsys, "info", model)
    assert code == 0
    assert "steps per second: 5.0" in out


def test_encode_writes_a_state_with_players_where_their_boxes_stand(encoded):
    state, positions = encoded
    for name, place in tiny_model.PLACES.items():
        assert positions[name] == pytest.approx(place, abs=0.02)
    assert set(json.loads(state.read_text())["objects"]) == {"ground", *tiny_model.PLACES}


@pytest.mark.parametrize(
    ("name", "text"), [("camera", "{}"), ("boxes", '{"player_1": [1, 2]}'), ("boxes", "{")]
)
def test_encode_refuses_malformed_files_by_name(capsys, model, clip, tmp_path, name, text):
    files = {"camera": json.dumps(tiny_model.camera().as_dict()), "boxes": "{}"} | {name: text}
    options = []
    for key, content in files.items():
        (tmp_path / f"{key}.json").write_text(content)
        options += [f"--{key}", tmp_path / f"{key}.json"]
    picture = clip / "00000/frames/0/0000.png"
    code, _, err = run(
        capsys, "encode", picture, *options, "-o", tmp_path / "s.json", "--model", model
    )
    assert code == 1
    assert f"{name}.json" in err
    assert not (tmp_path / "s.json").exists()


def test_render_draws_passes_again_when_told_not_to_resume(capsys, model, clip, tmp_path):
    start = Start("00000/frames/0/0000.png", tiny_model.camera(), tiny_model.boxes())
    shot = Shot(
        version=1,
        model=model,
        start=start,
        fps=5.0,
        frame_start=10,
        frame_end=11,
        cameras=(tiny_model.camera(),) * 2,
        objects=(ObjectTrack("player_1", ((10, 1),)),),
        passes=("depth", "mask:player_1"),
    )
    file = clip / "shot.json"
    file.write_text(shot.to_json())
    assert result(capsys, "render", file, "-o", tmp_path)["written"] == [10, 11]
    assert (tmp_path / "0010.exr").is_file()
    assert result(capsys, "render", file, "-o", tmp_path)["kept"] == [10, 11]
    assert result(capsys, "render", file, "-o", tmp_path, "--no-resume")["kept"] == []


def test_frames_and_sizes_are_read_from_text():
    assert parse_frames("1-3, 7") == [1, 2, 3, 7]
    assert parse_size("256x144") == (256, 144)
    for text in ("", "a", "1-", "1-b", "-3"):
        with pytest.raises(ShotError, match="1-24,30"):
            parse_frames(text)


def test_dataset_info_tells_what_a_data_set_holds(capsys, clip, tmp_path):
    facts = result(capsys, "dataset", "info", clip)
    assert (facts["complete_episodes"], facts["frames"], facts["size"]) == (1, 3, "32x16")
    code, _, err = run(capsys, "dataset", "info", tmp_path)
    assert code == 1
    assert "dataset.json" in err


def test_evaluate_prints_figures_as_a_table_and_as_json(capsys, model, clip):
    figures = result(capsys, "evaluate", "--model", model, "--data", clip)["figures"]
    assert figures["reconstruction_psnr"]["unit"] == "dB"
    code, out, _ = run(capsys, "evaluate", "--model", model, "--data", clip)
    assert code == 0
    assert "PSNR" in out


TINY = """
[model]
width = 32
height = 16
[model.classes.player]
kind = "playable"
samples = 2
style_features = 4
pose_features = 3
bending = { width = 8, depth = 1 }
field = { width = 8, depth = 1, head_width = 8 }
encoder = { height = 8, width = 8, channels = [4], hidden = 8 }
[[model.objects]]
name = "player_1"
class_name = "player"
[[model.objects]]
name = "player_2"
class_name = "player"
[model.action]
actions = 3
hidden = 8
dynamics_width = 8
[synthesis]
steps = 2
sequences = 2
patch_height = 16
patch_width = 16
[actions]
steps = 2
batch = 4
"""


def test_both_trainings_make_a_model_that_plays(capsys, clip, tmp_path):
    config, runs = tmp_path / "tiny.toml", tmp_path / "runs"
    config.write_text(TINY)
    options = ("--config", config, "--data", clip)
    code, out, err = run(capsys, "train", "synthesis", *options, "-o", runs / "s", "--json")
    assert code == 0, err
    synthesis = json.loads(out)["model"]
    options = ("--checkpoint", synthesis, *options, "-o", runs / "a", "--json")
    code, out, err = run(capsys, "train", "actions", *options)
    assert code == 0, err
    facts = result(capsys, "info", json.loads(out)["model"])
    # Those that nobody takes are taken out.
    assert 1 <= len(facts["actions"]["player_1"]) <= 3
    code, _, err = run(capsys, "train", "actions", *options)
    assert (code, "holds another run" in err) == (1, True)


def test_a_training_config_with_an_unknown_key_is_refused(capsys, clip, tmp_path):
    (tmp_path / "c.toml").write_text("[synthesis]\nstps = 3\n")
    options = ("--config", tmp_path / "c.toml", "--data", clip, "-o", tmp_path / "run")
    code, _, err = run(capsys, "train", "synthesis", *options)
    assert code == 1
    assert "did you mean 'steps'" in err


def test_the_extension_holds_the_addon_and_the_contract_and_nothing_heavy(capsys, tmp_path):
    made = result(capsys, "extension", "build", "-o", tmp_path)
    with zipfile.ZipFile(made["file"]) as archive:
        names = archive.namelist()
        (wheel,) = [name for name in names if name.startswith("wheels/")]
        archive.extract(wheel, tmp_path)
    assert {"blender_manifest.toml", "__init__.py", "worker/worker_client.py"} <= set(names)
    assert not [name for name in names if "datagen" in name or "demo_scene" in name]
    with zipfile.ZipFile(tmp_path / wheel) as archive:
        packed = [name for name in archive.namelist() if name.endswith(".py")]
    assert "pe_runtime/contract/shot.py" in packed
    assert {Path(name).parent.as_posix() for name in packed} == {
        "pe_runtime",
        "pe_runtime/contract",
    }


def test_the_bundled_contract_runs_without_the_rest_of_the_runtime(capsys, tmp_path):
    made = result(capsys, "extension", "build", "-o", tmp_path)
    with zipfile.ZipFile(made["file"]) as archive:
        archive.extractall(tmp_path)
    (wheel,) = tmp_path.glob("wheels/*.whl")
    code = (
        "import sys, numpy; from pe_runtime.contract import camera, episode, messages, shot; "
        "assert camera.__file__.startswith(sys.argv[1]); assert 'torch' not in sys.modules"
    )
    # -I would hide the wheel; -S hides the installed package but numpy with it.
    program = f"import sys; sys.path.insert(0, sys.argv[1]); {code}"
    done = subprocess.run([sys.executable, "-c", program, str(wheel)], cwd=tmp_path)
    assert done.returncode == 0


@pytest.mark.blender
@pytest.mark.slow
def test_blender_installs_the_extension_and_registers_its_operators(capsys, tmp_path):
    made = result(capsys, "extension", "build", "-o", tmp_path)
    assert made["validated"]
    program = (
        "import sys, bpy, addon_utils\n"
        "bpy.ops.extensions.package_install_files("
        "filepath=sys.argv[1], repo='user_default', enable_on_install=True)\n"
        "module = 'bl_ext.user_default.playable_environments'\n"
        "assert addon_utils.check(module) == (True, True)\n"
        "assert bpy.ops.playable.bake_paths.idname() == 'PLAYABLE_OT_bake_paths'\n"
        # Blender 4.5 waits for ever at the end of a program with operators registered.
        "import os; os._exit(0)\n"
    )
    command = [sys.executable, "-c", program, made["file"]]
    # Must be in place before bpy is imported: else it installs into the user's own Blender.
    resources = os.environ | {"BLENDER_USER_RESOURCES": str(tmp_path / "blender")}
    done = subprocess.run(command, cwd=tmp_path, env=resources, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_the_worker_command_serves_the_wire():
    command = [sys.executable, "-m", "pe_runtime.cli", "worker", "--fake"]
    done = subprocess.run(command, cwd=ROOT, input=b"", capture_output=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, b"", b"")


def test_the_command_line_starts_without_torch():
    code = "import sys, pe_runtime.cli; sys.exit('torch' in sys.modules or 'cv2' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT).returncode == 0


@pytest.mark.blender
def test_recording_ends_with_what_the_data_set_holds(capsys, tmp_path):
    wanted = ("--sequences", "1", "--size", "64x36", "--seed", "5", "--views", "2")
    facts = result(capsys, "dataset", "record", *wanted, "-o", tmp_path / "data")
    assert (facts["complete_episodes"], facts["views"], facts["seed"]) == (1, 2, 5)
    assert facts["size"] == "64x36"


def test_a_narrow_window_or_a_file_gets_whole_tables(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "40")
    # Nothing of what a command before was asked for.
    monkeypatch.setattr(terminal, "_given", ContextVar("given"))
    headings = tuple(f"a heading of column {number}" for number in range(6))
    rows = (("a case with a long name", *(f"{number}.0e-07" for number in range(5))),)
    terminal.show({}, as_table(Sheet("title", headings, rows)))
    said = capsys.readouterr().out
    assert all(text in said for text in (*headings, *rows[0]))
