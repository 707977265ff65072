"""Recordings made by a real Blender: exact, complete, the same in every process."""

import filecmp
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest

from pe_runtime.contract.camera import project
from pe_runtime.contract.episode import episode_path, read_dataset, read_episode
from pe_runtime.contract.errors import EpisodeError
from pe_runtime.recording import RecordingJob, record

pytestmark = pytest.mark.blender

ROOT = Path(__file__).parents[2]
PLAYER_HEIGHT = 1.8
OPTIONS = ("--seed", "5", "--views", "2", "--frames", "2")


def run_recorder(output, *options):
    command = [sys.executable, "-m", "blender_addon.datagen", "--size", "64x36", "-o", str(output)]
    return subprocess.run(
        [*command, *options], cwd=ROOT, capture_output=True, text=True, timeout=300, check=False
    )


def pixels(path):
    image = OpenImageIO.ImageBuf(str(path)).get_pixels("uint8")
    return image[..., 0] if image.shape[-1] == 1 else image


@pytest.fixture(scope="module")
def duel(tmp_path_factory):
    """Sequences 3 and 4 of `duel`, two frames and two views each."""
    root = tmp_path_factory.mktemp("duel")
    done = run_recorder(root, *OPTIONS, "--sequence-range", "3", "5")
    assert done.returncode == 0, done.stderr
    assert done.stdout.split("\n") == ['{"episode": 3}', '{"episode": 4}', ""]
    return root


@pytest.fixture(scope="module")
def episode(duel):
    return read_episode(episode_path(duel, 3))


def views_and_frames(episode):
    return [(v, t) for v in range(episode.arrays.views) for t in range(episode.arrays.frames)]


def test_a_recording_holds_what_its_description_says(duel, episode):
    info, paths = read_dataset(duel)
    assert (info.scene, info.seed, info.width, info.height, info.views) == ("duel", 5, 64, 36, 2)
    assert info.objects == ("player_1", "player_2")
    assert info.actions == ("idle", "left", "right", "forward", "back", "raise_arm")
    assert info.steps_per_second == 5.0
    assert [path.name for path in paths] == ["00003", "00004"]
    for view, frame in views_and_frames(episode):
        assert pixels(episode.frame_path(view, frame)).shape == (36, 64, 3)
        assert pixels(episode.mask_path(view, frame)).shape == (36, 64)
        assert episode.depth(view, frame).shape == (36, 64)


def test_a_sequence_is_the_same_whichever_process_records_it(duel, tmp_path):
    assert run_recorder(tmp_path, *OPTIONS, "--sequence-range", "4", "5").returncode == 0
    first, second = episode_path(duel, 4), episode_path(tmp_path, 4)
    files = sorted(path.relative_to(first) for path in first.rglob("*") if path.is_file())
    assert len(files) == 2 + 3 * 4
    same, _, _ = filecmp.cmpfiles(first, second, files, shallow=False)
    assert sorted(map(Path, same)) == files


def test_positions_follow_the_plan(episode):
    from blender_addon.datagen.motion import draw_sequence

    motion = draw_sequence(5, 3).motion
    np.testing.assert_allclose(episode.arrays.positions, motion.positions[:2], atol=1e-6)
    np.testing.assert_array_equal(episode.arrays.actions, motion.actions[:1])


def test_boxes_are_the_tight_bounds_of_the_masks(episode):
    for view, frame in views_and_frames(episode):
        ids = pixels(episode.mask_path(view, frame))
        assert set(np.unique(ids)) <= {0, 1, 2}
        for k in range(2):
            left, top, right, bottom = episode.arrays.boxes[view, frame, k].astype(int)
            inside = ids[top:bottom, left:right] == k + 1
            assert inside.sum() == (ids == k + 1).sum()
            assert inside[0].any() and inside[-1].any()
            assert inside[:, 0].any() and inside[:, -1].any()


def test_a_player_stands_where_its_position_is_seen(episode):
    for view, frame in views_and_frames(episode):
        feet = episode.arrays.positions[frame]
        camera = episode.camera(view, frame)
        bottom, _ = project(camera, feet)
        top, _ = project(camera, feet + (0, 0, PLAYER_HEIGHT))
        boxes = episode.arrays.boxes[view, frame]
        np.testing.assert_allclose(boxes[:, 3], bottom[:, 1], atol=2.5)
        assert (boxes[:, 1] < top[:, 1] + 2).all()
        assert (boxes[:, 0] < bottom[:, 0]).all() and (bottom[:, 0] < boxes[:, 2]).all()


def test_depth_through_the_camera_lies_on_court_and_wall(episode):
    for view, frame in views_and_frames(episode):
        camera = episode.camera(view, frame)
        depth = episode.depth(view, frame).astype(np.float64)
        ids = pixels(episode.mask_path(view, frame))
        rows, columns = np.nonzero(np.isfinite(depth) & (ids == 0))
        on_sensor = np.stack([columns + 0.5, rows + 0.5, np.ones(len(rows))])
        rays = np.linalg.solve(camera.intrinsics, on_sensor)
        in_camera = (rays * depth[rows, columns]).T
        pose = camera.world_from_camera
        world = in_camera @ pose[:3, :3].T + pose[:3, 3]
        off = np.minimum(np.abs(world[:, 2]), np.abs(world[:, 1] - 9.0))
        # float16 keeps 11 bits: 0.008 m at 16 m.
        assert off.max() < 0.02
        assert (np.abs(world[:, 2]) < 0.02).sum() > 200


def test_surfaces_of_one_colour_are_free_of_noise(episode):
    picture = pixels(episode.frame_path(0, 0)).reshape(-1, 3)
    counts = np.unique(picture, axis=0, return_counts=True)[1]
    # Two floors, a wall: a handful of exact colours fills most of the picture.
    assert np.sort(counts)[-4:].sum() > 0.5 * len(picture)


def test_an_interrupted_episode_is_redone_and_complete_ones_are_left_alone(duel, tmp_path):
    root = shutil.copytree(duel, tmp_path / "data")
    whole = {path: path.read_bytes() for path in root.rglob("*") if path.is_file()}
    complete = [path for path in whole if "00004" in path.parts]
    before = {path: path.stat().st_mtime_ns for path in complete}
    half = episode_path(root, 3)
    (half / "episode.json").unlink()
    (half / "arrays.npz").write_bytes(b"half")
    (half / "frames" / "0" / "9999.png").write_bytes(b"left over")
    assert run_recorder(root, *OPTIONS, "--sequence-range", "3", "5").returncode == 0
    assert {path: path.read_bytes() for path in root.rglob("*") if path.is_file()} == whole
    assert {path: path.stat().st_mtime_ns for path in complete} == before


def test_another_recording_in_the_folder_is_not_touched(duel):
    done = run_recorder(duel, "--seed", "6", "--views", "2", "--sequence-range", "9", "10")
    assert done.returncode == 1
    assert "holds another recording" in done.stderr
    assert not episode_path(duel, 9).exists()


def test_a_size_that_is_none_is_refused(tmp_path):
    done = run_recorder(tmp_path, "--size", "64")
    assert done.returncode == 2
    assert "write it like 256x144" in done.stderr


def scene_with_a_ball(bpy, frames=3):
    """A red ball on an Empty that moves 1 m a frame, a floor, a sun and a tilted camera."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end, scene.frame_step = 10, 10 + 2 * (frames - 1), 2
    scene.render.fps = 12
    bpy.ops.mesh.primitive_plane_add(size=40)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.5, location=(0, 0, 0.5))
    ball = bpy.context.object
    root = bpy.data.objects.new("root", None)
    scene.collection.objects.link(root)
    ball.parent = root
    root["pe_playable"] = "ball"
    for k in range(frames):
        root.location = (k - 1.0, 0.5 * k, 0.0)
        root["pe_action"] = 3 * k
        root.keyframe_insert("location", frame=10 + 2 * k)
        root.keyframe_insert('["pe_action"]', frame=10 + 2 * k)
    bpy.ops.object.light_add(type="SUN")
    bpy.ops.object.camera_add(location=(0, -8, 2), rotation=(1.4, 0, 0))
    scene.camera = bpy.context.object
    return scene, root


def save(bpy, folder):
    path = folder / "ball.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


@pytest.fixture
def bpy():
    return pytest.importorskip("bpy")


def test_any_scene_with_marked_objects_can_be_recorded(bpy, tmp_path):
    scene_with_a_ball(bpy)
    job = RecordingJob(os.fspath(save(bpy, tmp_path)), 1, 0, (64, 36), tmp_path / "data")
    info = record(job, 1)
    assert (info.scene, info.objects, info.actions) == ("ball", ("ball",), ())
    assert info.steps_per_second == 6.0
    found = read_episode(episode_path(job.output, 0))
    np.testing.assert_allclose(found.arrays.positions[:, 0], [[-1, 0, 0], [0, 0.5, 0], [1, 1, 0]])
    np.testing.assert_array_equal(found.arrays.actions[:, 0], [0, 3])
    for frame in range(3):
        centre, depth = project(found.camera(0, frame), found.arrays.positions[frame] + (0, 0, 0.5))
        left, top, right, bottom = found.arrays.boxes[0, frame, 0]
        np.testing.assert_allclose([(left + right) / 2, (top + bottom) / 2], centre[0], atol=1)
        column, row = centre[0].astype(int)
        assert found.depth(0, frame)[row, column] == pytest.approx(depth[0] - 0.5, abs=0.05)


def test_action_keys_hold_until_the_next_one(bpy, tmp_path):
    from blender_addon.datagen.recordable import open_blend

    scene, root = scene_with_a_ball(bpy, frames=4)
    root.animation_data_clear()
    for frame, action in ((10, 4), (16, 0)):
        root["pe_action"] = action
        root.keyframe_insert('["pe_action"]', frame=frame)
    source = open_blend(save(bpy, tmp_path))
    (ball,) = source.playables().values()
    seen = []
    for frame in source.frames:
        source.scene.frame_set(frame)
        seen.append(ball["pe_action"])
    assert seen == [4, 4, 4, 0]


def test_an_object_without_an_action_property_has_unknown_actions(bpy, tmp_path):
    from blender_addon.datagen.recordable import open_blend
    from blender_addon.datagen.recorder import Recording, dataset_info, record_episode

    _, root = scene_with_a_ball(bpy, frames=2)
    root.animation_data_clear()
    del root["pe_action"]
    root.location.x = 50
    source = open_blend(save(bpy, tmp_path))
    recording = Recording(16, 9, 1)
    info = dataset_info(source, recording, 0, 1)
    record_episode(source, recording, info, tmp_path / "00000", {})
    arrays = read_episode(tmp_path / "00000").arrays
    assert (arrays.actions == -1).all()
    assert not arrays.present.any(), "the ball is far outside the picture"
    assert np.isnan(arrays.boxes).all()


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda scene, root: root.pop("pe_playable"), "found none.*pe_playable"),
        (lambda scene, root: scene.objects["Plane"].__setitem__("pe_playable", "ball"), "own name"),
        (lambda scene, root: root.children[0].__setitem__("pe_playable", "b"), "below it"),
    ],
)
def test_a_scene_that_cannot_be_recorded_says_why(bpy, tmp_path, spoil, message):
    from blender_addon.datagen.recordable import open_blend

    scene, root = scene_with_a_ball(bpy)
    spoil(scene, root)
    with pytest.raises(EpisodeError, match=message):
        open_blend(save(bpy, tmp_path))


def test_a_view_without_a_camera_is_an_error(bpy, tmp_path):
    from blender_addon.datagen.recordable import open_blend

    scene_with_a_ball(bpy)
    source = open_blend(save(bpy, tmp_path))
    assert len(source.cameras(1)) == 1
    with pytest.raises(EpisodeError, match="expected 2 cameras, found none for view 1"):
        source.cameras(2)


def test_a_file_that_is_no_scene_is_an_error(bpy, tmp_path):
    from blender_addon.datagen.recordable import open_blend

    (tmp_path / "broken.blend").write_bytes(b"this is no scene")
    with pytest.raises(EpisodeError, match="broken.blend cannot be opened"):
        open_blend(tmp_path / "broken.blend")
    with pytest.raises(EpisodeError, match="missing.blend does not exist"):
        open_blend(tmp_path / "missing.blend")


def test_boxes_need_a_dozen_pixels(bpy):
    from blender_addon.datagen.recorder import SMALLEST_VISIBLE, tight_boxes

    ids = np.zeros((20, 30), dtype=np.uint8)
    ids[4, 3 : 3 + SMALLEST_VISIBLE] = 1
    ids[10, 3 : 2 + SMALLEST_VISIBLE] = 2
    boxes = tight_boxes(ids, 3)
    np.testing.assert_array_equal(boxes[0], [3, 4, 15, 5])
    assert np.isnan(boxes[1:]).all()


def test_grid_of_rays_becomes_the_nearest_srgb_bytes(bpy):
    from blender_addon.datagen.appearance import linear
    from blender_addon.datagen.passes import srgb_bytes

    levels = np.arange(256)
    scene_linear = np.array([linear((v / 255,) * 3)[:3] for v in levels])
    np.testing.assert_array_equal(srgb_bytes(scene_linear)[:, 0], levels)
    np.testing.assert_array_equal(srgb_bytes(np.array([-1.0, 7.0])), [0, 255])
