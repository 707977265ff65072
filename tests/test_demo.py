"""The demo: what it asks of Blender, what it makes of the answer, and the real thing at the end."""

import json

import numpy as np
import pytest
import tiny_model

from pe_runtime.demo import DemoError, DemoOptions, film, run_demo
from pe_runtime.demo.contact_sheet import Cell, write_contact_sheet
from pe_runtime.demo.script import demo_runs, find_action
from pe_runtime.images import ImageError, read_image, write_png

# Stands for Blender: copies the picture as every frame and reports.
STAND_IN = """
import json, pathlib, shutil, sys
spec = json.loads(pathlib.Path(sys.argv[2]).read_text())
out = pathlib.Path(spec["out"])
print("filming")
frames = []
for number in range(spec["frame_start"], spec["frame_end"] + 1):
    frames.append(str(out / "frames" / f"{number:04d}.png"))
    shutil.copy(spec["image"], frames[-1])
(out / "demo.blend").write_text("")
report = {"stages": {"render": 2.0, "bake": 0.5}, "frames": frames, "paths": {"player_1": []}}
report["video"] = str(out / "demo.mp4")
(out / "blender_report.json").write_text(json.dumps(report))
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A model and a clip."""
    folder = tmp_path_factory.mktemp("demo")
    clip = tiny_model.write_clip(folder / "clip")
    return tiny_model.write_model(folder / "tiny.safetensors"), clip


def options(made, **changes):
    return DemoOptions(model=made[0], clip=made[1], device="cpu", **changes)


def blender_is(monkeypatch, program):
    monkeypatch.setattr(film, "BLENDER_PROGRAM", ("-c", program))


def test_the_report_has_stages_rate_likeness_and_the_action_track(made, monkeypatch, tmp_path):
    blender_is(monkeypatch, STAND_IN)
    progress = []
    report = run_demo(tmp_path, options(made), lambda *each: progress.append(each))
    assert json.loads((tmp_path / "report.json").read_text()) == report
    assert (report["frames"], report["frames_per_second"]) == (24, 12.0)
    assert {"load model", "blender", "blender render"} <= set(report["seconds"])
    assert np.isfinite(report["psnr_of_first_frame"])
    # The tiny model has neither "back" nor a gesture: those become idle.
    assert report["actions"]["player_1"] == [[1, "idle"], [8, "right"], [15, "idle"]]
    assert progress[-1] == (24, 24)
    assert read_image(report["contact_sheet"]).shape[0] > 3 * tiny_model.HEIGHT


def test_the_spec_asks_for_the_first_picture_only_and_for_named_actions(
    made, monkeypatch, tmp_path
):
    blender_is(monkeypatch, STAND_IN)
    run_demo(tmp_path, options(made, actions="player_2=left*4,right*2", size=(64, 32)))
    spec = json.loads((tmp_path / "spec.json").read_text())
    assert spec["image"].endswith("frames/0/0000.png")
    assert spec["actions"] == {"player_2": [[1, "left"], [10, "right"]]}
    assert (spec["width"], spec["height"], spec["frame_end"], spec["fps"]) == (64, 32, 24, 12)
    assert set(spec["boxes"]) == {"player_1", "player_2"}
    assert spec["camera"] == tiny_model.camera().as_dict()


def test_nothing_of_an_earlier_demo_is_taken_for_new(made, monkeypatch, tmp_path):
    blender_is(monkeypatch, STAND_IN)
    run_demo(tmp_path, options(made))
    keep = tmp_path / "notes.txt"
    keep.write_text("mine")
    blender_is(monkeypatch, "")
    with pytest.raises(DemoError):
        run_demo(tmp_path, options(made))
    assert not list((tmp_path / "frames").iterdir())
    assert not (tmp_path / "report.json").exists()
    assert keep.exists()


@pytest.mark.parametrize(
    ("program", "named"),
    [
        ("import sys; sys.exit('the camera fell over')", "the camera fell over"),
        ("raise ModuleNotFoundError(\"No module named 'bpy'\")", "pip install"),
        ("", "exit code 0"),
    ],
)
def test_a_failure_in_blender_is_an_error_with_its_last_words(
    made, monkeypatch, tmp_path, program, named
):
    blender_is(monkeypatch, program)
    with pytest.raises(DemoError, match=named):
        run_demo(tmp_path, options(made))


def test_the_script_finds_learnt_names_and_their_numbered_twins():
    names = ("idle", "left-2", "back-left", "gesture", "forward")
    assert find_action(("left",), names) == 1
    assert find_action(("back", "back-left"), names) == 2
    assert find_action(("raise_arm", "gesture"), names) == 3
    assert find_action(("right",), names) == 0
    assert find_action(("right",), ("unused", "stay")) == 1
    assert find_action(("right",), ("unused",)) == 0


def test_the_two_players_are_told_different_things_for_the_whole_film():
    names = ("idle", "left", "right", "forward", "back", "raise_arm")
    runs = demo_runs(["a", "b", "c"], {"a": names, "b": names, "c": names})
    assert runs["a"] != runs["b"]
    assert runs["a"] == runs["c"]
    assert [sum(count for _, count in run) for run in runs.values()] == [10, 10, 10]


def test_a_contact_sheet_keeps_the_pixels_of_its_pictures_and_shows_text(tmp_path):
    picture = np.random.default_rng(0).integers(0, 256, (40, 60, 3), dtype=np.uint8)
    write_png(tmp_path / "a.png", picture)
    cells = [Cell(tmp_path / "a.png", f"frame {i}", "left") for i in range(4)]
    write_contact_sheet(cells, tmp_path / "sheet.png")
    sheet = np.round(read_image(tmp_path / "sheet.png") * 255)
    np.testing.assert_array_equal(sheet[6:46, 6:66], picture)
    np.testing.assert_array_equal(sheet[86:126, 6:66], picture)
    assert (sheet[47:79, 6:66] < 128).any()
    with pytest.raises(ImageError, match="no pictures"):
        write_contact_sheet([], tmp_path / "none.png")


@pytest.mark.blender
@pytest.mark.slow
def test_blender_films_different_paths_for_different_keys_over_the_same_ground(made, tmp_path):
    reports = [
        run_demo(tmp_path / name, options(made, actions=f"player_1={name}*9;player_2=idle"))
        for name in ("left", "right")
    ]
    for report in reports:
        assert len(report["paths"]["player_1"]) == 24
        for file in ("blend", "video", "contact_sheet"):
            assert (tmp_path / report[file]).stat().st_size > 0
    one, other = (np.array(report["paths"]["player_1"]) for report in reports)
    assert np.abs(one - other).max() > 1e-3
    np.testing.assert_allclose(one[0], other[0], atol=1e-5)
