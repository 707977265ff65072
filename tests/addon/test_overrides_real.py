"""Overrides with the shipped model: they change what they promise, and the film is drawn alike."""

import json

import numpy as np
import pytest
from addon import real_duel
from addon.stage import read_png

from pe_runtime.environment import PlayableEnvironment
from pe_runtime.shots import load_shot, render_shot

bpy = pytest.importorskip("bpy")
from blender_addon import playables  # noqa: E402 - after the check for Blender
from blender_addon.scene_bridge import look_through, playable_objects  # noqa: E402

pytestmark = pytest.mark.blender
FRAMES = 6


@pytest.fixture
def baked(addon, scene):
    """The shipped clip's first picture; both players act, a frame is a step of the model."""
    addon.use_command(real_duel.WORKER)
    start = real_duel.duel_start()
    look_through(scene.camera, scene.render, start.camera)
    boxes = json.dumps({name: list(box) for name, box in start.boxes.items()})
    bpy.ops.playable.new_environment(image=start.image, model="duel", boxes=boxes, camera="SCENE")
    scene.render.resolution_percentage = 25
    scene.frame_end, scene.render.fps = FRAMES, 5
    for each in playable_objects(scene).values():
        playables.key_action(each, 1, 3)
    bpy.ops.playable.bake_paths()
    return scene


def player(scene, name="player_1"):
    return playable_objects(scene)[name]


def key(scene, member, frame, value, name="player_1"):
    setattr(player(scene, name).playable.overrides, member, value)
    player(scene, name).keyframe_insert(f"playable.overrides.{member}", frame=frame)


def rendered(scene, folder):
    scene.render.image_settings.color_mode = "RGB"
    scene.render.filepath = str(folder / "f_####")
    bpy.ops.render.render(animation=True, scene=scene.name)
    frames = [read_png(path) for path in sorted(folder.glob("*.png"))]
    assert [frame.shape for frame in frames] == [(real_duel.HEIGHT, real_duel.WIDTH, 3)] * FRAMES
    return frames


def changed(before, after):
    """Which frames differ, counted from 1."""
    pairs = enumerate(zip(before, after, strict=True), start=1)
    return [number for number, (a, b) in pairs if not np.array_equal(a, b)]


def test_a_style_changes_its_player_from_the_key_where_its_mix_begins(baked, tmp_path):
    plain = rendered(baked, tmp_path / "plain")
    own = player(baked).playable.overrides
    own.style, own.style_object = "OBJECT", lender_of(own)
    key(baked, "style_mix", 3, 0.0)
    key(baked, "style_mix", 5, 1.0)
    styled = rendered(baked, tmp_path / "styled")
    assert changed(plain, styled) == [4, 5, 6]
    shares = [np.abs(a.astype(int) - b).sum() for a, b in zip(plain, styled, strict=True)]
    assert 0 < shares[3] < shares[4]
    own.style = "OWN"
    assert changed(plain, rendered(baked, tmp_path / "again")) == []


def test_a_held_pose_changes_the_frames_after_the_one_that_it_keeps(baked, tmp_path):
    plain = rendered(baked, tmp_path / "plain")
    key(baked, "pose", 3, "HELD")
    key(baked, "pose", 6, "FREE")
    assert changed(plain, rendered(baked, tmp_path / "held")) == [4, 5]


def test_the_exported_film_is_the_engines_to_the_bit(baked, tmp_path):
    start = real_duel.duel_start()
    baked.playable_environment.styles.camera = "SCENE"
    bpy.ops.playable.add_style(
        image=start.image, boxes=json.dumps({"player_2": list(start.boxes["player_2"])})
    )
    own = player(baked).playable.overrides
    own.style, own.style_source = "PICTURE", "S1"
    key(baked, "style_mix", 2, 0.0)
    key(baked, "style_mix", 4, 0.7)
    key(baked, "pose", 2, "HELD", "player_2")
    key(baked, "pose", 5, "FREE", "player_2")
    bpy.context.view_layer.objects.active = player(baked)
    baked.frame_set(4)
    bpy.ops.playable.leave_path()
    player(baked).location.x += 0.4
    player(baked).keyframe_insert("location", frame=5)
    frames = rendered(baked, tmp_path / "engine")
    bpy.ops.playable.export_shot(filepath=str(tmp_path / "film" / "film.json"))
    shot = load_shot(tmp_path / "film" / "film.json")
    render_shot(PlayableEnvironment.load("duel", "auto"), shot, tmp_path / "farm")
    drawn = [read_png(path) for path in sorted((tmp_path / "farm").glob("*.png"))]
    assert changed(frames, drawn) == []


def lender_of(own):
    """The only other object of the first player's class."""
    with pytest.raises(TypeError) as refused:
        own.style_object = "nobody"
    names = [part.strip("' ") for part in str(refused.value).rpartition("(")[2].split(",")]
    (lender,) = [name.strip("')") for name in names if name.strip("')") != "NONE"]
    return lender
