"""A model from recorded pictures to figures, by the commands that a user types."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import run
from small_world import small_clips
from thin_vgg import write_vgg

from pe_runtime.contract.episode import DatasetInfo, EpisodeArrays, write_dataset, write_episode
from pe_runtime.images import read_image, write_png

ROOT = Path(__file__).parents[2]
ACTIONS = ("idle", "left", "right")
CONFIG = """
[model]
name = "smoke"
width = 40
height = 24
[model.classes.ground]
low = [-5.0, -5.0, -0.02]
high = [5.0, 4.0, 0.0]
axes = [0, 1]
samples = 1
opaque = true
style_features = 4
field = { width = 12, depth = 2, octaves = 3, head_width = 8 }
encoder = { crop = "frame", height = 8, width = 16, channels = [4, 8], hidden = 8 }
[model.classes.sky]
kind = "sky"
low = [-5.0, -5.0, -0.02]
high = [5.0, 4.0, 0.0]
samples = 1
opaque = true
style_features = 4
field = { width = 12, depth = 2, octaves = 3, head_width = 8 }
encoder = { crop = "frame", height = 8, width = 16, channels = [4, 8], hidden = 8 }
[model.classes.player]
kind = "playable"
low = [-0.5, -0.6, 0.0]
high = [0.6, 0.5, 1.7]
samples = 4
style_features = 4
pose_features = 3
field = { width = 12, depth = 2, octaves = 2, head_width = 8 }
bending = { width = 8, depth = 2, octaves = 2 }
encoder = { height = 16, width = 12, channels = [4, 8], hidden = 8 }
[[model.objects]]
name = "ground"
class_name = "ground"
[[model.objects]]
name = "sky"
class_name = "sky"
[[model.objects]]
name = "player_1"
class_name = "player"
[[model.objects]]
name = "player_2"
class_name = "player"
[model.feature_renderer]
strides = [2, 4]
features = [6, 6]
widths = [8, 8]
output_widths = [8]
[model.action]
actions = 3
hidden = 8
dynamics_width = 8
discriminator_width = 8
[synthesis]
steps = 60
sequences = 2
patch_height = 16
patch_width = 16
learning_rate = 8e-3
renderer_learning_rate = 8e-3
warmup = 3
evaluate_every = 30
density_noise = 0.3
density_noise_until = 0.5
octaves_until = 0.3
patch_weights = { player = 1.0, player_2 = 2.0 }
[actions]
steps = 40
batch = 8
log_every = 20
shortest = 3
learning_rate = 1e-2
first_teacher_forcing = 0.0
"""


def record(root, seed):
    """Small clips as a recorder leaves them on disk."""
    clips = small_clips(count=3, frames=5, seed=seed)
    count, frames, height, width = clips.images.shape[:4]
    info = DatasetInfo("smoke", 0, count, 5.0, width, height, clips.players, ACTIONS, 1)
    write_dataset(root, info)
    for clip in range(count):
        folder = root / f"{clip:05d}"
        (folder / "frames" / "0").mkdir(parents=True)
        for frame in range(frames):
            picture = clips.images[clip, frame].numpy()
            write_png(folder / "frames" / "0" / f"{frame:04d}.png", picture)
        arrays = EpisodeArrays(
            intrinsics=clips.intrinsics[clip].numpy()[None],
            world_from_camera=clips.world_from_camera[clip].numpy()[None],
            boxes=clips.boxes[clip].numpy()[None],
            present=np.ones((1, frames, 2), bool),
            positions=clips.positions[clip].numpy().astype(np.float64),
            actions=np.full((frames - 1, 2), 2, np.int8),
        )
        write_episode(folder, info, arrays, {})
    return root


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Configuration and two recorded data sets."""
    folder = tmp_path_factory.mktemp("place")
    (folder / "smoke.toml").write_text(CONFIG)
    record(folder / "train", 1)
    record(folder / "val", 2)
    return folder


def options(place):
    return ("--config", place / "smoke.toml", "--data", place / "train")


def figures(folder):
    return [json.loads(line) for line in (folder / "metrics.jsonl").read_text().splitlines()]


def test_two_processes_train_a_module_whose_actions_are_learnt_and_measured(capsys, place):
    """The whole way, the first part of it under torchrun."""
    module, runs = place / "runs" / "synthesis", place / "runs"
    chosen = (*options(place), "--val", place / "val", "-o", module, "--json")
    command = [sys.executable, "-m", "torch.distributed.run", "--standalone"]
    command += ["--nproc-per-node", "2", "-m", "pe_runtime.cli", "train", "synthesis", *chosen]
    environment = os.environ | {"OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {"model": str(module / "synthesis.safetensors")}
    assert done.stderr.count("step 20: ") == 1
    losses = {line["step"]: line["loss"] for line in figures(module) if "loss" in line}
    assert sorted(losses) == [20, 40, 60]
    assert losses[60] < 0.7 * losses[20]
    measured = {line["step"]: line["psnr"] for line in figures(module) if "psnr" in line}
    assert measured[60] > measured[30] > 5
    assert [each.name for each in sorted((module / "samples").iterdir())] == [
        "0000030.png",
        "0000060.png",
    ]
    assert read_image(module / "curves.png").size > 0
    assert json.loads((module / "config.json").read_text())["synthesis"]["octaves_until"] == 0.3

    chosen = ("--checkpoint", module / "synthesis.safetensors", *options(place))
    code, out, err = run(capsys, "train", "actions", *chosen, "-o", runs / "actions", "--json")
    assert code == 0, err
    lines = figures(runs / "actions" / "player")
    assert lines[-1]["loss"] < 0.8 * lines[0]["loss"]
    model = json.loads(out)["model"]
    code, out, err = run(capsys, "evaluate", "--model", model, "--data", place / "val", "--json")
    assert code == 0, err
    assert json.loads(out)["figures"]["reconstruction_psnr"]["value"] > 5


def test_a_run_that_is_resumed_with_more_steps_goes_on_with_a_vgg(capsys, place, tmp_path):
    vgg = write_vgg(tmp_path / "vgg.pth", width=1)
    wider = (place / "smoke.toml").read_text().replace("patch_height = 16", "patch_height = 24")
    (tmp_path / "c.toml").write_text(wider.replace("patch_width = 16", "patch_width = 24"))
    chosen = ("--config", tmp_path / "c.toml", "--data", place / "train", "-o", tmp_path / "run")
    chosen = ("train", "synthesis", *chosen, "--vgg", vgg, "--json")
    for steps, more in ((2, ()), (3, ("--resume",))):
        code, _, err = run(capsys, *chosen, "--steps", steps, *more)
        assert code == 0, err
    assert [line["step"] for line in figures(tmp_path / "run")] == [2, 3]
    described = json.loads((tmp_path / "run" / "config.json").read_text())["synthesis"]
    assert (described["perceptual"], described["perceptual_weights"]) == ("vgg", str(vgg))


def test_actions_refuse_to_be_learnt_by_several_processes(capsys, place, tmp_path, monkeypatch):
    monkeypatch.setenv("WORLD_SIZE", "2")
    chosen = ("--checkpoint", tmp_path / "s.safetensors", *options(place), "-o", tmp_path)
    code, _, err = run(capsys, "train", "actions", *chosen)
    assert (code, "without torchrun" in err) == (1, True)
