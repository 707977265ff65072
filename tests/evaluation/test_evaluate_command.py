"""`pe evaluate --table` and its sample sheets, with a real model of few weights."""

import json

import numpy as np
import pytest
from command_line import result, run
from tiny_model import write_clip, write_model

from pe_runtime.checkpoint import load_checkpoint, save_checkpoint
from pe_runtime.evaluation import confidence, long_play
from pe_runtime.evaluation.sheets import Sheet
from pe_runtime.images import read_image


@pytest.fixture(scope="module", autouse=True)
def quick():
    from dataclasses import replace

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(confidence, "RESAMPLES", 5)
        short = replace(long_play.LONG_PLAY, steps=12, early=4, late=6, starts=1)
        patch.setattr(long_play, "LONG_PLAY", short)
        yield


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    return write_clip(tmp_path_factory.mktemp("clip"), frames=4)


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return write_model(tmp_path_factory.mktemp("model") / "tiny.safetensors")


@pytest.fixture(scope="module")
def synthesis_only(model, tmp_path_factory):
    """What the first training phase leaves: no actions, no names of them."""
    header, tensors = load_checkpoint(model)
    own = {name: each for name, each in tensors.items() if name.startswith("synthesis.")}
    path = tmp_path_factory.mktemp("runs") / "full" / "synthesis.safetensors"
    save_checkpoint(path, own, {"kind": "synthesis", "config": header["config"], "steps": 1})
    return path


def test_playability_is_a_row_of_the_paper_in_json(capsys, model, clip):
    report = result(capsys, "evaluate", "--data", clip, "--model", model, "--table", "playability")
    row = report["tables"]["playability"]["tiny"]
    assert {"lpips_r", "fd_r", "fvd_r", "delta_mse", "psnr"} <= set(row["figures"])
    assert report["detector"] == "own"
    assert len(report["protocol"]["hash"]) == 12


def test_all_tables_of_a_model_are_written_with_sample_sheets(capsys, model, clip, tmp_path):
    code, out, _ = run(
        capsys, "evaluate", "--data", clip, "--model", model, "--table", "all",
        "--detector", "none", "--out", tmp_path,
    )  # fmt: skip
    assert code == 0
    for heading in ("tiny: reconstruction", "tiny: playability", "tiny: long-play"):
        assert heading in out
    stored = json.loads((tmp_path / "report.json").read_text())
    # One camera recorded the clip: there is nothing to control.
    assert set(stored["tables"]) == {"reconstruction", "playability", "long-play"}
    sheets = {path.name for path in tmp_path.glob("*.png")}
    assert sheets == {"poses.png", "styles.png", "playability.png", "long-play.png"}
    assert read_image(tmp_path / "poses.png").shape[1] > 4 * 192


def test_a_synthesis_module_has_pictures_but_no_playability(capsys, synthesis_only, clip):
    runs = synthesis_only.parent.parent
    command = ("evaluate", "--data", clip, "--runs", runs, "--detector", "none")
    report = result(capsys, *command, "--table", "ablation-synthesis")
    assert set(report["tables"]["ablation-synthesis"]["full"]["figures"]) >= {"psnr", "fd_r"}
    code, _, err = run(capsys, *command, "--table", "ablation-actions")
    assert code == 1
    assert "holds no run for the table 'ablation-actions'" in err
    code, _, err = run(
        capsys, "evaluate", "--data", clip, "--model", synthesis_only, "--table", "playability"
    )
    assert code == 1
    assert "pe train actions" in err


def test_one_camera_alone_is_a_clear_refusal_at_the_camera_table(capsys, model, clip):
    code, _, err = run(
        capsys, "evaluate", "--data", clip, "--model", model, "--table", "camera"
    )  # fmt: skip
    assert code == 1
    assert "a second view" in err


def test_half_of_the_lpips_files_is_a_clear_refusal(capsys, model, clip, tmp_path):
    code, _, err = run(
        capsys, "evaluate", "--data", clip, "--table", "reconstruction", "--vgg", tmp_path / "v.pth"
    )  # fmt: skip
    assert code == 1
    assert "--lpips-heads" in err


def test_a_sheet_holds_its_pictures_under_their_labels(tmp_path):
    sheet = Sheet()
    red, blue = np.zeros((2, 10, 20, 3), np.float32)
    red[..., 0], blue[..., 2] = 1.0, 1.0
    sheet.add("first", [red, blue])
    sheet.add("second", [blue])
    picture = read_image(sheet.write(tmp_path / "deep" / "sheet.png"))
    assert picture.shape == (2 * (10 + 16 + 4) + 4, 2 * 24 + 4, 3)
    assert picture[4 + 16 + 5, 4 + 5].tolist() == [1.0, 0.0, 0.0]
    assert picture[4 + 16 + 5, 28 + 5].tolist() == [0.0, 0.0, 1.0]
    assert picture[4 + 30 + 16 + 5, 4 + 5].tolist() == [0.0, 0.0, 1.0]


def test_a_model_without_players_is_judged_by_its_pictures_alone(capsys, clip, tmp_path):
    plain = write_model(tmp_path / "plain.safetensors", players=())
    report = result(capsys, "evaluate", "--data", clip, "--model", plain, "--table", "all")
    assert set(report["tables"]) == {"reconstruction"}
    assert "psnr" in report["tables"]["reconstruction"]["plain"]["figures"]
    figures = result(capsys, "evaluate", "--data", clip, "--model", plain)["figures"]
    assert set(figures) == {"reconstruction_psnr", "reconstruction_ssim"}
