"""Ranges in processes of their own, as farms run them: halves, at once, and without a model."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")
from blender_addon import playables  # noqa: E402 - after the check for Blender
from blender_addon.scene_bridge import playable_objects  # noqa: E402
from blender_addon.strips.manifest import read_manifest  # noqa: E402
from pe_runtime.contract.shot import Shot  # noqa: E402

pytestmark = pytest.mark.blender
COUNT = 8
PROCESS = [sys.executable, "-u", str(Path(__file__).with_name("render_process.py"))]
DEADLINE = 120.0


@pytest.fixture
def baked(environment):
    environment.frame_end = COUNT
    playables.key_action(playable_objects(environment)["player_1"], 1, 1)
    playables.key_action(playable_objects(environment)["player_2"], 4, 3)
    bpy.ops.playable.bake_paths()
    return environment


def saved(scene, tmp_path):
    path = tmp_path / "film.blend"
    scene.render.image_settings.color_mode = "RGB"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    return path


def start(mode, film, folder, *frames):
    tests = Path(__file__).parents[1]
    paths = [str(tests), str(tests.parent), os.environ.get("PYTHONPATH", "")]
    return subprocess.Popen(
        [*PROCESS, mode, str(film), str(folder), *map(str, frames)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def ended(process):
    """Exit code and what was said beside `ready`."""
    _, said = process.communicate(timeout=DEADLINE)
    return process.returncode, [line for line in said.splitlines() if line not in ("ready", "")]


@pytest.mark.parametrize("mode", ["animation", "once"])
def test_two_halves_of_a_range_give_the_files_of_one_run(baked, tmp_path, mode):
    film = saved(baked, tmp_path)
    runs = [
        start(mode, film, tmp_path / "halves", 1, 5),
        start(mode, film, tmp_path / "halves", 6, COUNT),
        start(mode, film, tmp_path / "whole"),
    ]
    assert [ended(each)[0] for each in runs] == [0, 0, 0]
    halves, whole = (
        {path.name: path.read_bytes() for path in (tmp_path / name).glob("*.png")}
        for name in ("halves", "whole")
    )
    assert len(whole) == COUNT and halves == whole
    assert len(set(whole.values())) > 1


def test_what_a_farm_has_rendered_at_once_is_only_gathered_at_home(baked, tmp_path):
    film, frames = saved(baked, tmp_path), tmp_path / "frames"
    runs = [start("once", film, frames, *part) for part in ((1, 3), (4, 6), (7, COUNT))]
    assert [ended(each)[0] for each in runs] == [0, 0, 0]
    assert list(read_manifest(frames).frames) == list(range(1, COUNT + 1))
    before = {path: path.stat().st_mtime_ns for path in frames.glob("*.png")}
    bpy.ops.playable.render_to_sequencer(folder=str(frames))
    assert {path: path.stat().st_mtime_ns for path in frames.glob("*.png")} == before
    (strip,) = baked.playable_environment.edit_scene.sequence_editor.strips
    assert len(strip.elements) == COUNT


@pytest.mark.parametrize("mode", ["animation", "once"])
def test_without_its_model_a_range_ends_with_exit_code_1_and_one_clear_line(baked, tmp_path, mode):
    settings = baked.playable_environment
    content = json.loads(settings.bake_text.as_string())
    content["shot"]["model"] = settings.model = "/models/gone.safetensors"
    content["digest"] = Shot.from_dict(content["shot"]).digest()
    settings.bake_text.from_string(json.dumps(content))
    code, said = ended(start(mode, saved(baked, tmp_path), tmp_path / "frames"))
    assert code == 1
    assert len(said) == 1 and "/models/gone.safetensors" in said[0], said
    assert list((tmp_path / "frames").glob("*.png")) == []
