"""Frames through the real render engine: exact bytes, passes, and failures that stop."""

import os
import signal
from pathlib import Path

import numpy as np
import pytest
from addon.stage import (
    BOXES,
    FAKE,
    HEIGHT,
    WIDTH,
    exr_channels,
    faulty,
    front_camera,
    picture_of,
    read_png,
    render_layers,
)

bpy = pytest.importorskip("bpy")
from blender_addon import playables  # noqa: E402 - after the check for Blender
from blender_addon.bake import (  # noqa: E402
    Output,
    bake_of,
    take_as_baked,
    take_of_moment,
)
from blender_addon.filming.pixels import FAR_AWAY  # noqa: E402
from blender_addon.scene_bridge import playable_objects, sample_range  # noqa: E402
from blender_addon.worker.replies import WorkerCancelledError  # noqa: E402

pytestmark = pytest.mark.blender


@pytest.fixture
def baked(environment):
    playables.key_action(playable_objects(environment)["player_1"], 1, 1)
    bpy.ops.playable.bake_paths()
    return environment


def render_still(scene, path, frame=1):
    scene.frame_set(frame)
    scene.render.image_settings.color_mode = "RGB"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True, scene=scene.name)
    return path


def render_range(scene, folder):
    scene.render.image_settings.color_mode = "RGB"
    scene.render.filepath = str(folder / "f_####")
    bpy.ops.render.render(animation=True, scene=scene.name)
    return sorted(folder.glob("*.png"))


def drawn_by(addon, scene, frame):
    return addon.render(bake_of(scene.playable_environment).shot, frame)


def test_a_saved_png_holds_the_workers_bytes_for_all_256_values(baked, addon, tmp_path):
    baked.render.resolution_x, baked.render.resolution_y = 256, 8
    for each in playable_objects(baked).values():
        each.hide_render = True
    path = render_still(baked, tmp_path / "still.png")
    bake, moment = bake_of(baked.playable_environment), sample_range(baked, [1])[0]
    take = take_of_moment(bake, moment, 10.0, Output(256, 8))
    expected = addon.render(take, 1, whole=bake.shot).rgb
    assert set(np.unique(expected)) == set(range(256))
    assert np.array_equal(read_png(path), expected)


def test_one_frame_alone_is_the_same_file_as_in_the_range(baked, tmp_path):
    baked.frame_end = 12
    bpy.ops.playable.bake_paths()
    files = render_range(baked, tmp_path / "range")
    alone = render_still(baked, tmp_path / "alone.png", frame=12)
    assert len(files) == 12
    assert np.array_equal(read_png(alone), read_png(files[11]))
    pixels_in = [path.read_bytes().split(b"IDAT", 1)[1] for path in (alone, files[11])]
    assert pixels_in[0] == pixels_in[1]
    assert not np.array_equal(read_png(files[0]), read_png(files[11]))


def switch_on_all_passes(scene):
    scene.view_layers[0].use_pass_z = True
    for each in playable_objects(scene).values():
        each.playable.use_mask = True


def test_depth_and_masks_arrive_in_a_multilayer_exr(baked, addon, tmp_path):
    switch_on_all_passes(baked)
    bpy.ops.playable.bake_paths()
    channels = exr_channels(render_layers(baked, tmp_path / "passes.exr"))
    drawn = drawn_by(addon, baked, 1)
    expected = np.where(np.isinf(drawn.depth), FAR_AWAY, drawn.depth)
    assert np.array_equal(channels["Depth.Z"], expected)
    assert {name for name in channels if "Mask" in name} == {f"Mask {name}.X" for name in BOXES}
    for name in BOXES:
        assert np.array_equal(channels[f"Mask {name}.X"], drawn.masks[name])
        assert drawn.masks[name].any()


def test_an_empty_that_was_moved_or_hidden_after_baking_is_drawn_so(baked, tmp_path):
    before = read_png(render_still(baked, tmp_path / "before.png"))
    target = playable_objects(baked)["player_2"]
    playables.remove_curves(target, "location")
    target.location.x += 0.5
    moved = read_png(render_still(baked, tmp_path / "moved.png"))
    target.hide_render = True
    hidden = read_png(render_still(baked, tmp_path / "hidden.png"))
    red = [(image[..., 0] == 230).sum(axis=0) for image in (before, moved, hidden)]
    assert np.flatnonzero(red[0]).max() < np.flatnonzero(red[1]).max()
    assert (red[2] > 0).sum() < (red[0] > 0).sum()


def test_a_camera_moved_after_baking_changes_the_view_and_not_the_paths(baked, addon):
    bake, output = bake_of(baked.playable_environment), Output(WIDTH, HEIGHT)
    untouched = take_of_moment(bake, sample_range(baked, [2])[0], 10.0, output)
    assert untouched == take_as_baked(bake, 2, output)
    baked.camera.location.x += 1.0
    take = take_of_moment(bake, sample_range(baked, [2])[0], 10.0, output)
    assert take.cameras[0] != bake.shot.cameras[1] == untouched.cameras[0]
    assert take.objects == untouched.objects


def test_no_playable_object_at_all_still_renders(scene, picture, tmp_path):
    bpy.ops.playable.new_environment(image=str(picture), model="fake", boxes="{}")
    bpy.ops.playable.bake_paths()
    assert read_png(render_still(scene, tmp_path / "empty.png")).shape == (HEIGHT, WIDTH, 3)


def test_a_failure_in_the_worker_stops_the_range_and_writes_no_black_frame(baked, addon, tmp_path):
    addon.use_command(faulty("fails"))
    with pytest.raises(RuntimeError, match="frame 3: the lens fell off"):
        render_range(baked, tmp_path / "range")
    assert [path.name for path in sorted((tmp_path / "range").glob("*"))] == [
        "f_0001.png",
        "f_0002.png",
    ]


def test_a_killed_worker_is_a_clear_error_and_the_next_render_works(baked, addon, tmp_path):
    addon.use_command(faulty("dies"))
    with pytest.raises(RuntimeError, match="the worker ended .exit code 7") as caught:
        render_still(baked, tmp_path / "dead.png", frame=3)
    assert "out of memory, or so" in str(caught.value)
    assert list(tmp_path.glob("dead*")) == []
    assert render_still(baked, tmp_path / "alive.png", frame=2).is_file()
    addon.use_command(FAKE)
    addon.facts("fake")
    os.kill(addon.worker_pid, signal.SIGKILL)
    addon._client._process.wait()
    assert render_still(baked, tmp_path / "again.png", frame=3).is_file()


def test_a_picture_of_the_wrong_size_is_an_error(baked, addon, tmp_path):
    addon.use_command(faulty("small"))
    with pytest.raises(RuntimeError, match="expected a picture of 64x36 pixels"):
        render_still(baked, tmp_path / "small.png")
    assert not (tmp_path / "small.png").exists()


def test_rendering_before_baking_is_a_clear_error(environment, tmp_path):
    with pytest.raises(RuntimeError, match="press Bake Paths before rendering"):
        render_still(environment, tmp_path / "early.png")
    assert not (tmp_path / "early.png").exists()


def orthographic(scene):
    scene.camera.data.type = "ORTHO"


def beyond_the_end(scene):
    scene.frame_set(9)


def other_pace(scene):
    scene.render.fps = 25


def other_action(scene):
    playables.key_action(playable_objects(scene)["player_1"], 1, 2)


def stereoscopic(scene):
    scene.render.use_multiview = True


def one_player_less(scene):
    playable_objects(scene)["player_1"].playable.is_playable = False


def stretched_root(scene):
    scene.playable_environment.root.scale = (1, 1, 3)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (orthographic, "camera type is ORTHO"),
        (beyond_the_end, "frame 9 is outside the baked range 1 to 4"),
        (other_pace, "runs at 25 fps, the bake at 10"),
        (other_action, "action keys of 'player_1' have changed"),
        (stereoscopic, "stereoscopy is on"),
        (one_player_less, "the bake knows the playable objects"),
        (stretched_root, "stretched or mirrored"),
    ],
)
def test_what_cannot_be_filmed_is_refused_with_a_reason(baked, tmp_path, change, reason):
    change(baked)
    with pytest.raises(RuntimeError, match=reason):
        render_still(baked, tmp_path / "no.png", frame=baked.frame_current)
    assert not (tmp_path / "no.png").exists()


def test_colour_settings_that_would_change_bytes_are_named(baked, tmp_path, capfd):
    render_still(baked, tmp_path / "exact.png")
    assert "will differ" not in capfd.readouterr().out
    baked.view_settings.view_transform = "AgX"
    baked.render.dither_intensity = 1.0
    render_still(baked, tmp_path / "agx.png")
    said = capfd.readouterr().out
    assert "View Transform is AgX, not Standard" in said and "Dither is 1" in said


def test_cancelling_returns_while_the_worker_is_still_drawing(baked, addon, tmp_path, monkeypatch):
    from blender_addon.filming.engine import PlayableEnvironmentEngine

    addon.use_command(faulty("slow"))
    addon.facts("fake")
    asked = []
    shot = bake_of(baked.playable_environment).shot
    with pytest.raises(WorkerCancelledError):
        addon.render(shot, 1, lambda: asked.append(1) or True)
    assert len(asked) == 1 and addon._client._inbox.empty()
    # Without an Esc, a cancelled frame is an error and never a black file.
    monkeypatch.setattr(addon, "render", _cancelled)
    with pytest.raises(RuntimeError, match="was cancelled"):
        render_still(baked, tmp_path / "cancelled.png")
    assert not Path(tmp_path / "cancelled.png").exists()
    assert PlayableEnvironmentEngine.bl_idname == baked.render.engine


def _cancelled(*_):
    raise WorkerCancelledError("cancelled")


def test_an_interrupt_inside_the_engine_is_no_black_frame(baked, addon, tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(addon, "render", interrupted)
    with pytest.raises(RuntimeError, match="KeyboardInterrupt"):
        render_still(baked, tmp_path / "stopped.png")
    assert not (tmp_path / "stopped.png").exists()


def test_the_stage_fits_the_picture():
    assert picture_of().shape[:2] == (front_camera().height, front_camera().width)
