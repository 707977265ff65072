"""`import_official`: whole checkpoints in, one model file out, and all that can go wrong."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from interop.official_weights import (
    NEVER_RUN,
    action_shapes,
    environment_shapes,
    environment_weights,
    save_stage,
)

from pe_runtime.checkpoint import load_checkpoint
from pe_runtime.contract.errors import CheckpointError
from pe_runtime.environment import PlayableEnvironment, RenderOptions
from pe_runtime.interop.conventions import camera_from_theirs
from pe_runtime.interop.official_checkpoint import import_official

WORLDS = ("tennis", "minecraft")


def broadcast_camera(world):
    angles, place, focal, up = {
        "tennis": ((1.37, 0.02, -0.01), (0.3, -38.0, 8.5), 1172.0, "z"),
        "minecraft": ((-0.42, 0.86, 0.0), (7.9, 3.6, 4.8), 327.0, "y"),
    }[world]
    return camera_from_theirs(np.array(angles), np.array(place), focal, (512, 288), up)


BOXES = {
    "tennis": {"player_1": (170.0, 150.0, 210.0, 240.0), "player_2": (285.0, 60.0, 300.0, 95.0)},
    "minecraft": {
        "player_1": (200.0, 120.0, 230.0, 190.0),
        "player_2": (280.0, 110.0, 300.0, 160.0),
    },
}


@pytest.mark.parametrize(("world", "count"), [("tennis", 807), ("minecraft", 795)])
def test_the_tables_cover_the_published_environment_models(world, count):
    # The entries of the autoencoder's encoder are known by their prefix alone.
    listed = [n for n in environment_shapes(world) if n not in NEVER_RUN]
    encoder, offsets = 108, 1
    assert len(listed) + encoder + offsets == count


@pytest.mark.parametrize(("world", "count"), [("tennis", 126), ("minecraft", 63)])
def test_the_tables_cover_the_published_playable_models(world, count):
    assert len(action_shapes(world)) == count


@pytest.mark.parametrize("world", WORLDS)
def test_a_stage_3_file_alone_becomes_a_model_that_encodes_acts_and_draws(models, world):
    report, environment = models[world]
    assert report.world == world
    assert report.files == {f"{world}_3.pth.tar": 150000}
    camera = broadcast_camera(world)
    picture = np.random.default_rng(0).random((288, 512, 3), np.float32)
    state = environment.encode(picture, camera, BOXES[world])
    assert {name for name, each in state.objects.items() if each.visible} >= set(BOXES[world])
    actions = {name: 2 for name in environment.playable_names}
    after, memory = environment.step(state, actions, camera)
    again, _ = environment.step(after, actions, camera, memory)
    for name in actions:
        assert not torch.equal(after[name].position, again[name].position)
        assert after[name].position[2] == state[name].position[2]
        assert torch.equal(again[name].style, state[name].style)
        assert (again[name].heading != state[name].heading) == (world == "minecraft")
    small = camera.scaled(128, 72)
    frame = environment.render(again, small, RenderOptions(depth=True, masks=("player_1",)))
    assert frame.rgb.shape == (72, 128, 3)
    assert np.isfinite(frame.rgb).all()
    assert frame.statistics["hits"] > 0


@pytest.mark.parametrize("world", WORLDS)
def test_every_action_gets_a_name_of_its_own(models, world):
    report, environment = models[world]
    classes = {"tennis": {"near_player", "far_player"}, "minecraft": {"player"}}[world]
    assert set(report.actions) == classes
    for names in environment.action_names.values():
        assert len(names) == len(set(names)) == 7


def test_the_header_says_where_the_weights_are_from(models):
    imported = models["tennis"][1].header["imported"]
    assert imported["world"] == "tennis"
    assert "CC BY-NC" in imported["licence"]


def test_a_stage_2_file_alone_becomes_a_model_without_actions(files, tmp_path):
    report = import_official([files["tennis"][0]], tmp_path / "model.safetensors")
    assert report.actions == {}
    assert report.same_environment is None
    environment = PlayableEnvironment.load(report.path, "cpu")
    with pytest.raises(CheckpointError, match="no actions"):
        environment._module("player_1", 0)


def test_both_files_in_any_order_give_what_the_stage_3_file_gives(files, models, tmp_path):
    two, three = files["tennis"]
    report = import_official([three, two], tmp_path / "model.safetensors")
    assert report.same_environment is True
    _, found = load_checkpoint(report.path)
    _, wanted = load_checkpoint(models["tennis"][0].path)
    assert found.keys() == wanted.keys()
    assert all(torch.equal(found[name], wanted[name]) for name in wanted)


def test_another_environment_than_the_actions_were_trained_with_is_reported(files, tmp_path):
    other = save_stage(tmp_path / "other.pth.tar", environment_weights("tennis", seed=9))
    report = import_official([other, files["tennis"][1]], tmp_path / "model.safetensors")
    assert report.same_environment is False


def test_names_stored_from_data_parallel_are_understood(weights, models, tmp_path):
    environment, actions = weights["minecraft"]
    copy = {f"environment_model.{name}": tensor for name, tensor in environment.items()}
    wrapped = {f"module.{name}": tensor for name, tensor in {**copy, **actions}.items()}
    path = save_stage(tmp_path / "wrapped.pth.tar", wrapped)
    report = import_official([path], tmp_path / "model.safetensors")
    _, found = load_checkpoint(report.path)
    _, wanted = load_checkpoint(models["minecraft"][0].path)
    assert all(torch.equal(found[name], wanted[name]) for name in wanted)


HEAD = "object_composer.object_models_coarse.2.nerf_model.alpha_head"


def test_all_that_does_not_fit_is_named_in_one_error_and_nothing_is_written(weights, tmp_path):
    broken = dict(weights["tennis"][0])
    broken[f"{HEAD}.weight"] = torch.zeros(2, 256)
    del broken[f"{HEAD}.bias"]
    broken["object_composer.surprise"] = torch.zeros(1)
    path = save_stage(tmp_path / "broken.pth.tar", broken)
    with pytest.raises(CheckpointError) as refused:
        import_official([path], tmp_path / "model.safetensors")
    said = str(refused.value)
    assert f"missing (1): {HEAD}.bias" in said
    assert "unexpected (1): object_composer.surprise" in said
    assert f"misshapen (1): {HEAD}.weight (2, 256) instead of (1, 256)" in said
    assert list(tmp_path.iterdir()) == [path]


def refusal(tmp_path, files, **options):
    before = sorted(tmp_path.iterdir())
    with pytest.raises(CheckpointError) as refused:
        import_official(files, tmp_path / "model.safetensors", **options)
    assert sorted(tmp_path.iterdir()) == before
    return str(refused.value)


def test_files_of_two_worlds_do_not_go_together(files, tmp_path):
    said = refusal(tmp_path, [files["minecraft"][0], files["tennis"][1]])
    assert "of the minecraft world" in said
    assert "of tennis" in said


def test_a_world_that_the_weights_are_not_of_is_refused(files, tmp_path):
    assert "was to be minecraft" in refusal(tmp_path, [files["tennis"][0]], world="minecraft")
    assert "no world 'golf'" in refusal(tmp_path, [files["tennis"][0]], world="golf")


def test_two_files_of_one_stage_and_none_at_all_are_refused(files, tmp_path):
    two = files["tennis"][0]
    assert "one of each" in refusal(tmp_path, [two, two])
    assert "one of each" in refusal(tmp_path, [])


def test_actions_without_their_environment_ask_for_it(weights, tmp_path):
    path = save_stage(tmp_path / "actions.pth.tar", weights["tennis"][1])
    assert "give the stage-2 checkpoint as well" in refusal(tmp_path, [path])


def test_a_feature_renderer_of_stage_1_is_named_as_such(tmp_path):
    path = save_stage(tmp_path / "one.pth.tar", {"decoder.weight": torch.zeros(1)})
    assert "feature renderer of stage 1" in refusal(tmp_path, [path])


class Attack:
    """What a malicious file would hold: reading it plainly runs a command."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


def test_a_pickle_that_calls_code_is_refused_and_not_run(tmp_path):
    mark = tmp_path / "executed"
    torch.save({"model": Attack(mark)}, tmp_path / "evil.pth.tar")
    assert "reading would execute" in refusal(tmp_path, [tmp_path / "evil.pth.tar"])
    (tmp_path / "old.pth.tar").write_bytes(pickle.dumps({"model": Attack(mark)}))
    assert "refused" in refusal(tmp_path, [tmp_path / "old.pth.tar"])
    assert not mark.exists()


def test_a_truncated_file_is_one_clear_error(files, tmp_path):
    whole = files["minecraft"][0].read_bytes()
    for name, size in (("half", len(whole) // 2), ("head", 100), ("nothing", 0)):
        (tmp_path / name).write_bytes(whole[:size])
        said = refusal(tmp_path, [tmp_path / name])
        assert str(tmp_path / name) in said
        assert "\n" not in said


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ({"weights": {}}, "found keys weights"),
        ([1, 2], "found list"),
        ({"model": {}}, "under 'model'"),
        ({"model": {"a": 1.0}}, "something else than tensors: a"),
        ({"model": {"a": torch.zeros(1)}}, "first entry: 'a'"),
    ],
)
def test_a_file_that_is_no_such_checkpoint_is_refused(tmp_path, content, says):
    torch.save(content, tmp_path / "other.pth.tar")
    assert says in refusal(tmp_path, [tmp_path / "other.pth.tar"])


def test_a_configuration_or_a_missing_file_is_no_checkpoint(tmp_path):
    (tmp_path / "config.yaml").write_text("model: {architecture: tennis}\n")
    assert "is refused" in refusal(tmp_path, [tmp_path / "config.yaml"])
    assert "no checkpoint at" in refusal(tmp_path, [tmp_path / "missing.pth.tar"])


def test_importing_again_gives_the_same_bytes(files, models, tmp_path):
    again = import_official([files["minecraft"][1]], tmp_path / "model.safetensors")
    assert again.path.read_bytes() == models["minecraft"][0].path.read_bytes()


MEASURED = """
import sys
import numpy as np
from pe_runtime.environment import PlayableEnvironment
from interop.test_official_checkpoint import BOXES, broadcast_camera

environment, camera = PlayableEnvironment.load(sys.argv[1], "cpu"), broadcast_camera("tennis")
picture = np.random.default_rng(0).random((288, 512, 3), np.float32)
frame = environment.render(environment.encode(picture, camera, BOXES["tennis"]), camera)
assert frame.rgb.shape == (288, 512, 3)
lines = open("/proc/self/status").read().splitlines()
print(next(line.split()[1] for line in lines if line.startswith("VmHWM")))
"""


@pytest.mark.skipif(not Path("/proc/self/status").is_file(), reason="needs Linux's /proc")
def test_a_whole_tennis_frame_stays_below_the_memory_it_may_have(models):
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-c", MEASURED, str(models["tennis"][0].path)],
        cwd=root,
        env=os.environ | {"PYTHONPATH": f"{root}{os.pathsep}{root / 'tests'}"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) / 1024**2 < 0.8, "GiB resident at the peak"
