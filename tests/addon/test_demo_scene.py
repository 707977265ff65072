"""The scene that builds, bakes, films and cuts itself, as the command that users run."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from addon.stage import BOXES, FAKE, HEIGHT, WIDTH, front_camera

from pe_runtime.contract.errors import ShotError

pytest.importorskip("bpy")
pytestmark = pytest.mark.blender
ROOT = Path(__file__).parents[2]


def run_demo(tmp_path, picture, **changes):
    spec = {
        "image": str(picture),
        "camera": front_camera().as_dict(),
        "boxes": BOXES,
        "model": "fake",
        "out": str(tmp_path / "out"),
        "frame_start": 1,
        "frame_end": 6,
        "fps": 10,
        "actions": {"player_1": [[1, "left"], [4, "raise_arm"]], "player_2": [[1, "forward"]]},
        "camera_move": {"azimuth_degrees": 12, "dolly_metres": -0.5},
        "width": WIDTH,
        "height": HEIGHT,
        "quality": "exact",
        "worker": FAKE,
    } | changes
    path = tmp_path / "spec.json"
    path.write_text(json.dumps(spec))
    command = [sys.executable, "-m", "blender_addon.examples.demo_scene", "--spec", str(path)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True)


def test_the_demo_scene_is_filmed_cut_and_saved(tmp_path, picture):
    done = run_demo(tmp_path, picture)
    assert done.returncode == 0, done.stderr
    out = tmp_path / "out"
    report = json.loads((out / "blender_report.json").read_text())
    assert set(report["stages"]) == {"scene", "encode", "keys", "bake", "render", "video", "save"}
    assert [Path(file).name for file in report["frames"]] == [
        f"frame_{number:04d}.png" for number in range(1, 7)
    ]
    assert all(Path(file).is_file() for file in report["frames"])
    assert Path(report["video"]) == out / "demo.mp4" and (out / "demo.mp4").stat().st_size > 500
    check_paths(report["paths"])
    check_saved_file(out / "demo.blend")


def check_paths(paths):
    assert {name: np.shape(path) for name, path in paths.items()} == dict.fromkeys(BOXES, (6, 3))
    first, second = (np.array(paths[name]) for name in BOXES)
    assert first[3, 0] < first[0, 0] - 0.2 and np.allclose(first[4:], first[3], atol=0.35)
    assert second[5, 1] > second[0, 1] + 0.2


def check_saved_file(path):
    program = (
        "import bpy, json, sys, blender_addon; blender_addon.register(); "
        f"bpy.ops.wm.open_mainfile(filepath={str(path)!r}); "
        "scene = bpy.data.scenes['Scene']; edit = scene.playable_environment.edit_scene; "
        "(strip,) = edit.sequence_editor.strips; "
        "assert strip.directory == '//frames/' or strip.directory == '//frames', strip.directory; "
        "assert scene.playable_environment.bake_text; "
        "assert scene.camera.animation_data.action; blender_addon.unregister()"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_a_spec_that_cannot_be_filmed_ends_with_its_reason(tmp_path, picture):
    done = run_demo(tmp_path, picture, actions={"player_1": [[1, "fly"]]})
    assert done.returncode != 0
    assert "no action 'fly'; it has idle, left" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out" / "blender_report.json").exists()


@pytest.mark.parametrize("text", ['{"colour": "blue"}', '{"image": "a.png"}', "[1]", "no json"])
def test_a_malformed_spec_is_refused_with_the_known_keys(tmp_path, text):
    from blender_addon.examples.demo_scene import read_spec

    (tmp_path / "spec.json").write_text(text)
    with pytest.raises(ShotError, match="a spec has the keys image, camera, boxes"):
        read_spec(tmp_path / "spec.json")
