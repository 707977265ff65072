"""The film as a file: the frames of the engine, drawn without Blender."""

import json
import shutil

import numpy as np
import pytest
from addon.stage import BOXES, HEIGHT, WIDTH, picture_of, read_png

from pe_runtime.images import write_png
from pe_runtime.shots import load_shot
from pe_runtime.worker.fake_world import FakeWorld

bpy = pytest.importorskip("bpy")
from blender_addon import playables  # noqa: E402 - after the check for Blender
from blender_addon.scene_bridge import playable_objects  # noqa: E402
from pe_runtime.contract.shot import PoseKey  # noqa: E402

pytestmark = pytest.mark.blender
FRAMES = 8


@pytest.fixture
def baked(environment):
    environment.frame_end = FRAMES
    playables.key_action(player(environment), 1, 1)
    bpy.ops.playable.bake_paths()
    bpy.context.view_layer.objects.active = player(environment)
    return environment


def player(scene, name="player_1"):
    return playable_objects(scene)[name]


def key(target, path, frame, value):
    owner, _, member = path.rpartition(".")
    setattr(target.path_resolve(owner) if owner else target, member, value)
    target.keyframe_insert(path, frame=frame)


def override_everything(scene, tmp_path):
    """Every kind of override, over different stretches of the range."""
    first, second = player(scene), player(scene, "player_2")
    kit = tmp_path / "kit.png"
    write_png(kit, picture_of()[::-1].copy())
    scene.playable_environment.styles.camera = "SCENE"
    boxes = json.dumps({"player_2": BOXES["player_2"]})
    bpy.ops.playable.add_style(image=str(kit), boxes=boxes)
    key(first, "playable.overrides.pose", 1, "FREE")
    key(first, "playable.overrides.pose", 3, "HELD")
    key(first, "playable.overrides.pose", 6, "FREE")
    own = second.playable.overrides
    own.style, own.style_source = "PICTURE", "S1"
    key(second, "playable.overrides.style_mix", 2, 0.0)
    key(second, "playable.overrides.style_mix", 5, 1.0)
    key(second, "playable.overrides.style_mix", 7, 1.0)
    key(second, "playable.overrides.style_mix", 8, 0.0)
    key(first, "hide_render", 1, False)
    key(first, "hide_render", 8, True)
    scene.frame_set(4)
    bpy.ops.playable.leave_path()
    first.location.x += 0.7
    first.keyframe_insert("location", frame=5)
    scene.camera.keyframe_insert("location", frame=2)
    scene.camera.location.z += 0.3
    scene.camera.keyframe_insert("location", frame=6)


def rendered(scene, folder):
    scene.render.image_settings.color_mode = "RGB"
    scene.render.filepath = str(folder / "f_####")
    bpy.ops.render.render(animation=True, scene=scene.name)
    return [read_png(path) for path in sorted(folder.glob("*.png"))]


def test_an_exported_shot_draws_the_frames_of_the_engine(baked, tmp_path):
    override_everything(baked, tmp_path)
    frames = rendered(baked, tmp_path / "engine")
    bpy.ops.playable.export_shot(filepath=str(tmp_path / "out" / "film.json"))
    # On another machine, without anything else that is here.
    shutil.move(tmp_path / "out", tmp_path / "farm")
    shot = load_shot(tmp_path / "farm" / "film.json")
    world = FakeWorld()
    world.load("fake")
    drawn = [picture.buffers["rgb"] for picture in world.render(shot, list(shot.frames))]
    assert len(drawn) == len(frames) == FRAMES
    for one, other in zip(drawn, frames, strict=True):
        assert np.array_equal(one, other)
    assert len({frame.tobytes() for frame in frames}) >= FRAMES - 1


def test_an_exported_shot_is_compact_and_its_files_are_beside_it(baked, tmp_path):
    override_everything(baked, tmp_path)
    bpy.ops.playable.export_shot(filepath=str(tmp_path / "out" / "film"))
    folder = tmp_path / "out"
    content = json.loads((folder / "film.json").read_text())
    named = {content["start"]["state"]} | {
        mix["image"] for track in content["objects"] for mix in track["styles"]
    }
    assert {path.name for path in folder.iterdir()} == {"film.json", *named - {None}}
    shot = load_shot(folder / "film.json")
    assert shot.track("player_1").poses == (PoseKey(4, 3), PoseKey(6, None))
    # A mix that moves is written where it moves, and its end once.
    mixed = [(mix.frame, round(mix.weight, 2)) for mix in shot.track("player_2").styles]
    assert [frame for frame, _ in mixed] == [3, 4, 5, 8] and mixed[-1][1] == 0.0
    assert shot.track("player_1").visible == (True,) * 7 + (False,)
    assert shot.track("player_2").locations is None


def test_a_film_without_overrides_is_the_baked_shot(baked, tmp_path):
    from blender_addon.bake import bake_of
    from blender_addon.state_files import portable

    bpy.ops.playable.export_shot(filepath=str(tmp_path / "film.json"))
    content = json.loads((tmp_path / "film.json").read_text())
    assert content == portable(bake_of(baked.playable_environment).shot).as_dict()


def test_another_size_and_its_passes_are_exported_too(baked, tmp_path):
    baked.render.resolution_percentage = 50
    baked.view_layers[0].use_pass_z = True
    bpy.ops.playable.export_shot(filepath=str(tmp_path / "film.json"))
    shot = load_shot(tmp_path / "film.json")
    assert (shot.cameras[0].width, shot.cameras[0].height) == (WIDTH // 2, HEIGHT // 2)
    assert shot.wants_depth


def test_exporting_leaves_what_was_moved_but_not_keyed(baked, tmp_path):
    baked.frame_set(3)
    player(baked).location.x += 2.0
    moved = player(baked).location.x
    bpy.ops.playable.export_shot(filepath=str(tmp_path / "film.json"))
    assert player(baked).location.x == moved and baked.frame_current == 3


def test_a_camera_that_has_turned_since_the_bake_is_refused(baked, tmp_path):
    baked.camera.rotation_euler.z += 0.2
    with pytest.raises(RuntimeError, match="the camera has turned since the bake .frame 1.*Bake"):
        bpy.ops.playable.export_shot(filepath=str(tmp_path / "film.json"))
    assert not (tmp_path / "film.json").exists()


def test_a_folder_that_takes_no_file_is_a_clear_error(baked, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RuntimeError, match="choose a folder that can be written"):
        bpy.ops.playable.export_shot(filepath=str(tmp_path / "file" / "film.json"))
    with pytest.raises(RuntimeError, match="no file is chosen"):
        bpy.ops.playable.export_shot(filepath="")


def test_without_a_bake_the_entry_says_why(environment):
    with pytest.raises(RuntimeError, match="Nothing is baked yet"):
        bpy.ops.playable.export_shot(filepath="x.json")
