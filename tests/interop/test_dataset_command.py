"""`pe dataset import-official` as its user meets it, up to a model trained on what it imported."""

import json

import pytest
import tiny_model
from interop.official_folders import SIZE, write_split

from pe_runtime.cli import main
from pe_runtime.dataset import load_clips


def run(capsys, *arguments):
    """Exit code, stdout and stderr of one command."""
    with pytest.raises(SystemExit) as stop:
        main([str(each) for each in arguments])
    said = capsys.readouterr()
    return stop.value.code or 0, said.out, said.err


def command(capsys, root, output, *more):
    size = "{}x{}".format(*SIZE)
    return run(capsys, "dataset", "import-official", root, "-o", output, "--size", size, *more)


def test_the_command_reports_what_it_imported_in_words_and_as_json(capsys, tmp_path):
    for name in ("train", "val"):
        write_split(tmp_path / "in" / name, world="minecraft", keypoints=[1] * 5)
    code, out, err = command(capsys, tmp_path / "in", tmp_path / "a", "--json")
    assert (code, err) == (0, "")
    report = json.loads(out)
    assert (report["world"], report["up"], report["told_by"]) == ("minecraft", "y", "cameras")
    assert (report["focal_multiplier"], report["steps_per_second"]) == (0.5, 25.0)
    assert [(each["split"], each["episodes"]) for each in report["splits"]] == [
        ("train", 2), ("val", 2),
    ]  # fmt: skip
    more = ("--split", "val", "--world", "minecraft", "--skip", "1", "--focal-multiplier", "0.4")
    code, out, err = command(capsys, tmp_path / "in", tmp_path / "b", *more)
    assert (code, err) == (0, "")
    assert "world: minecraft, told by --world (y up)" in out
    assert "12.5 steps a second, focal lengths times 0.4" in out
    assert "2 episodes of 3 frames (0 were there) from 2 of 2 sequences" in out
    assert "not imported: keypoints.pkl (2x)" in out
    code, out, _ = run(capsys, "dataset", "info", tmp_path / "b" / "val", "--json")
    facts = json.loads(out)
    assert (facts["scene"], facts["complete_episodes"], facts["views"]) == ("minecraft", 2, 1)
    assert facts["objects"] == ["player_1", "player_2"]


def test_damage_is_reported_and_ends_with_one_clear_line_and_status_one(capsys, tmp_path):
    root = write_split(tmp_path / "in", count=2)
    (root / "00001" / "00000" / "00002.png").unlink()
    code, out, err = command(capsys, root, tmp_path / "out", "--json")
    assert code == 1
    assert err.startswith("pe: 1 sequence(s) of ")
    assert "00001: frame 00002.png is missing in the middle" in err
    assert err.count("\n") == 1
    (skipped,) = json.loads(out)["splits"][0]["skipped"]
    assert skipped["sequence"] == "00001"
    assert len(load_clips(tmp_path / "out")) == 1
    code, out, err = command(capsys, root, tmp_path / "strict", "--strict")
    assert (code, out, err.count("\n")) == (1, "", 1)
    assert not (tmp_path / "strict").exists()


def test_wrong_options_and_folders_are_one_clear_line(capsys, tmp_path):
    root = write_split(tmp_path / "in")
    for more, status, named in [
        (("--split", "train,dev"), 1, "'dev' is unknown"),
        (("--world", "golf"), 1, "'golf' is unknown"),
        (("--skip", "-1"), 2, "skip"),
        (("--focal-multiplier", "0"), 1, "focal_multiplier is 0.0"),
    ]:
        code, out, err = command(capsys, root, tmp_path / "out", *more)
        assert (code, out) == (status, "")
        assert named in err
    code, _, err = command(capsys, tmp_path / "nowhere", tmp_path / "out")
    assert (code, err.count("\n")) == (1, 1)
    assert not (tmp_path / "out").exists()


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


@pytest.mark.parametrize("world", ["tennis", "minecraft"])
def test_a_model_is_trained_and_measured_on_an_imported_data_set(capsys, tmp_path, world):
    write_split(tmp_path / "in", world=world)
    data, config = tmp_path / "out", tmp_path / "tiny.toml"
    assert command(capsys, tmp_path / "in", data, "--size", "32x16")[0] == 0
    config.write_text(TINY)
    options = ("--config", config, "--data", data)
    code, out, err = run(capsys, "train", "synthesis", *options, "-o", tmp_path / "s", "--json")
    assert code == 0, err
    options = ("--checkpoint", json.loads(out)["model"], *options, "-o", tmp_path / "a", "--json")
    code, _, err = run(capsys, "train", "actions", *options)
    assert code == 0, err
    model = tiny_model.write_model(tmp_path / "model.safetensors")
    code, out, err = run(capsys, "evaluate", "--data", data, "--model", model, "--json")
    assert code == 0, err
    figures = json.loads(out)["figures"]
    assert {"reconstruction_psnr", "delta_mse", "rollout_error"} <= set(figures)
    assert figures["encoding_error"]["value"] < 0.01
