"""Tennis recorded by a real Blender, and the second camera of `duel-camera`."""

import filecmp
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest

from blender_addon.datagen.rally import draw_rally
from pe_runtime.contract.camera import project
from pe_runtime.contract.episode import episode_path, read_dataset, read_episode

pytestmark = pytest.mark.blender

ROOT = Path(__file__).parents[2]


def run_recorder(output, scene, *options):
    command = [sys.executable, "-m", "blender_addon.datagen", "--scene", scene, "--seed", "5"]
    done = subprocess.run(
        [*command, "-o", str(output), *options],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return output


def pixels(path):
    image = OpenImageIO.ImageBuf(str(path)).get_pixels("uint8")
    return image[..., 0] if image.shape[-1] == 1 else image


@pytest.fixture(scope="module")
def court(tmp_path_factory):
    root = tmp_path_factory.mktemp("court")
    return run_recorder(root, "court", "--frames", "2", "--views", "2")


@pytest.fixture(scope="module")
def episode(court):
    return read_episode(episode_path(court, 0))


@pytest.fixture(scope="module")
def static(tmp_path_factory):
    root = tmp_path_factory.mktemp("static")
    options = ("--frames", "1", "--size", "128x72", "--sequence-range", "0", "2")
    return run_recorder(root, "static-court", *options)


def test_a_recorded_court_has_two_players_and_six_actions(court, episode):
    info, _ = read_dataset(court)
    assert (info.scene, info.objects) == ("court", ("player_far", "player_near"))
    assert info.actions == ("idle", "left", "right", "forward", "back", "swing")
    np.testing.assert_allclose(episode.arrays.positions, draw_rally(5, 0).positions[:2], atol=1e-6)
    assert episode.arrays.present.all()


def test_players_stand_where_their_positions_are_seen(episode):
    for view, frame in np.ndindex(2, 2):
        feet, _ = project(episode.camera(view, frame), episode.arrays.positions[frame])
        boxes = episode.arrays.boxes[view, frame]
        # The nearer shoe may stand half a step before the body's middle.
        np.testing.assert_allclose(boxes[:, 3], feet[:, 1], atol=7)
        assert (boxes[:, 0] < feet[:, 0]).all() and (feet[:, 0] < boxes[:, 2]).all()
        assert (boxes[:, 3] - boxes[:, 1]).min() >= 26


def test_the_zoom_is_recorded_frame_by_frame(episode):
    angles = [view.field_of_view for view in draw_rally(5, 0).views[0][:2]]
    focal = episode.arrays.intrinsics[0, :, 0, 0]
    np.testing.assert_allclose(focal, 128 / np.tan(np.divide(angles, 2)), rtol=1e-5)
    assert focal[0] != focal[1]


def test_id_and_depth_are_those_of_what_stands_behind_the_net(episode):
    depth, camera = episode.depth(0, 0).astype(float), episode.camera(0, 0)
    ids = pixels(episode.mask_path(0, 0))
    places = np.array([(x, 0.0, 0.45) for x in np.linspace(-4.0, 4.0, 41) if abs(x) > 0.3])
    at, far = project(camera, places)
    columns, rows = at.astype(int).T
    free = ids[rows, columns] == 0
    assert free.sum() > 20
    # Through the net's middle one sees the court more than a metre behind it.
    assert (depth[rows, columns][free] > far[free] + 0.9).all()


def test_the_net_is_seen_in_the_picture(episode):
    picture, camera = pixels(episode.frame_path(0, 0)).astype(int), episode.camera(0, 0)
    through, _ = project(camera, np.array([(2.0, 0.0, 0.45)]))
    beside, _ = project(camera, np.array([(2.0, -0.6, 0.0)]))
    (net,), (floor,) = (
        picture[at.astype(int)[:, 1], at.astype(int)[:, 0]] for at in (through, beside)
    )
    assert net.sum() < 0.9 * floor.sum(), "darker than the floor before it"


def test_surfaces_of_one_colour_are_free_of_noise(episode):
    picture = pixels(episode.frame_path(0, 0)).reshape(-1, 3)
    counts = np.unique(picture, axis=0, return_counts=True)[1]
    # Inner and outer court, each also through the net.
    assert np.sort(counts)[-4:].sum() > 0.4 * len(picture)


def test_a_rally_is_the_same_whichever_process_records_it(court, tmp_path):
    run_recorder(tmp_path, "court", "--frames", "2", "--views", "2")
    first, second = episode_path(court, 0), episode_path(tmp_path, 0)
    files = sorted(path.relative_to(first) for path in first.rglob("*") if path.is_file())
    same, _, _ = filecmp.cmpfiles(first, second, files, shallow=False)
    assert sorted(map(Path, same)) == files


def test_limbs_move_against_the_body_and_feet_stay_on_the_ground():
    bpy = pytest.importorskip("bpy")
    from blender_addon.datagen.built_in import build_scene

    source = build_scene("court", 5, 0)
    body = bpy.data.objects["player_near_body"]
    shapes = []
    for frame in source.frames:
        source.scene.frame_set(frame)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        evaluated, root = (o.evaluated_get(depsgraph) for o in (body, body.parent.parent))
        corners = np.array([v.co[:] for v in evaluated.to_mesh().vertices])
        world = corners @ np.array(evaluated.matrix_world)[:3, :3].T
        world += np.array(evaluated.matrix_world)[:3, 3]
        assert abs(world[:, 2].min()) < 0.04
        turned = np.array(root.matrix_world)
        shapes.append((world - turned[:3, 3]) @ turned[:3, :3])
    moved = np.linalg.norm(np.diff(shapes, axis=0), axis=-1)
    assert moved.max() > 0.4, "a hand or a foot goes far"
    assert np.median(moved.min(axis=1)) < 0.05, "and the body's middle does not"


def test_the_static_court_has_one_player_one_camera_and_one_look(static):
    info, paths = read_dataset(static)
    assert (info.scene, info.objects) == ("static-court", ("player_near",))
    first, second = (read_episode(path) for path in paths)
    np.testing.assert_array_equal(first.arrays.world_from_camera, second.arrays.world_from_camera)
    both = [pixels(each.frame_path(0, 0)) for each in (first, second)]
    ids = [pixels(each.mask_path(0, 0)) for each in (first, second)]
    still = (ids[0] == 0) & (ids[1] == 0)
    same = (both[0] == both[1]).all(-1)[still]
    assert same.mean() > 0.95, "all but the players' shadows and edges"


def test_the_first_view_of_duel_camera_is_that_of_duel(tmp_path):
    options = ("--frames", "2", "--size", "64x36", "--views", "2")
    duel = run_recorder(tmp_path / "duel", "duel", *options)
    camera = run_recorder(tmp_path / "camera", "duel-camera", *options)
    first, second = (read_episode(episode_path(root, 0)) for root in (duel, camera))
    for frame in range(2):
        assert first.frame_path(0, frame).read_bytes() == second.frame_path(0, frame).read_bytes()
    np.testing.assert_allclose(
        second.arrays.world_from_camera[1, 0], second.arrays.world_from_camera[0, 0], atol=1e-6
    )
    assert not np.allclose(
        second.arrays.world_from_camera[1, 1], second.arrays.world_from_camera[0, 1], atol=1e-2
    )
