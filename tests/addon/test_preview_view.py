"""Where a viewport looks from: the very rays of Blender's own matrices and of the render."""

from types import SimpleNamespace

import numpy as np
import pytest

from blender_addon.preview.view_camera import Rect, seen_of_frame, view_camera
from pe_runtime.contract.camera import Camera, project
from pe_runtime.contract.errors import CameraError

bpy = pytest.importorskip("bpy")
from blender_addon.preview.looking import covered_bottom, look  # noqa: E402 - after the check for Blender
from blender_addon.scene_bridge import inverse_of, read_camera  # noqa: E402

POINTS = np.array([[0.0, 0.0, 0.0], [1.5, 2.0, 0.3], [-2.0, 1.0, 1.8], [0.4, -3.0, 0.9]])


def camera_of(width=160, height=90, focal=120.0, centre=(83.0, 41.0)):
    intrinsics = np.array([[focal, 0, centre[0]], [0, 1.1 * focal, centre[1]], [0, 0, 1.0]])
    pose = np.eye(4)
    pose[:3, :3] = [[1, 0, 0], [0, -0.28, 0.96], [0, -0.96, -0.28]]
    pose[:3, 3] = 0, -8, 2.5
    return Camera(width, height, intrinsics, pose)


def view_through(exact, zoom, offset, size):
    """The region's camera where its view through `exact` is zoomed and moved."""
    intrinsics = exact.intrinsics.copy()
    intrinsics[:2] *= zoom
    intrinsics[:2, 2] += offset
    return Camera(*size, intrinsics, exact.world_from_camera)


@pytest.mark.parametrize(
    ("zoom", "offset", "size"),
    [(1.0, (0, 0), (160, 90)), (2.7, (31.3, 12.1), (900, 500)), (6.0, (-301.7, -88.8), (400, 300))],
)
def test_the_frame_of_a_camera_view_is_seen_by_the_very_camera(zoom, offset, size):
    exact = camera_of()
    view = view_through(exact, zoom, offset, size)
    rect, camera = seen_of_frame(exact, view)
    assert 0 <= rect.left and 0 <= rect.top
    assert rect.left + rect.width <= size[0] and rect.top + rect.height <= size[1]
    seen, depth = project(camera, POINTS)
    expected, exact_depth = project(view, POINTS)
    np.testing.assert_allclose(seen + (rect.left, rect.top), expected, atol=1e-9)
    np.testing.assert_array_equal(depth, exact_depth)
    if zoom < 6:
        assert (rect.width, rect.height) == tuple(np.rint((160 * zoom, 90 * zoom)).astype(int))
    else:
        assert (rect.left, rect.top) == (0, 0)


def test_a_frame_out_of_sight_is_none():
    assert seen_of_frame(camera_of(), view_through(camera_of(), 1.0, (500, 0), (400, 300))) is None


def test_an_orthographic_view_says_which_key_to_press():
    flat = np.diag([0.1, 0.1, -0.01, 1.0])
    with pytest.raises(CameraError, match="press 5 on the number pad"):
        view_camera(flat, np.eye(4), (640, 480))


def region_of(scene, size=(320, 180), camera=None, perspective="CAMERA", window=None):
    """A context whose region looks through a camera, zoomed as `window` has it."""
    depsgraph = scene.view_layers[0].depsgraph
    holder = (camera or scene.camera).evaluated_get(depsgraph)
    if window is None:
        window = holder.calc_matrix_camera(depsgraph, x=size[0], y=size[1])
    return SimpleNamespace(
        region=SimpleNamespace(width=size[0], height=size[1]),
        region_data=SimpleNamespace(
            view_perspective=perspective,
            window_matrix=window,
            view_matrix=holder.matrix_world.inverted(),
        ),
        space_data=SimpleNamespace(use_local_camera=camera is not None, camera=camera),
    )


@pytest.mark.blender
class TestInBlender:
    """Blender's matrices."""

    def test_a_view_that_fills_the_region_is_the_camera_of_a_render_of_its_size(self, scene):
        scene.view_layers[0].update()
        depsgraph = scene.view_layers[0].depsgraph
        exact = read_camera(depsgraph).scaled(320, 180)
        for perspective in ("CAMERA", "PERSP"):
            context = region_of(scene, perspective=perspective)
            rect, camera = look(context, depsgraph, np.eye(4))
            assert rect == Rect(0, 0, 320, 180)
            seen, _ = project(camera, POINTS)
            np.testing.assert_allclose(seen, project(exact, POINTS)[0], atol=1e-3)

    def test_the_frame_stands_where_blender_draws_it_in_a_wider_region(self, scene):
        scene.view_layers[0].update()
        depsgraph = scene.view_layers[0].depsgraph
        scene.camera.data.shift_x = 0.1
        scene.view_layers[0].update()
        # The view of a region of 400x400 in which the frame of 16:9 is 320 wide.
        window = np.array(scene.camera.calc_matrix_camera(depsgraph, x=320, y=180))
        window[0] *= 320 / 400
        window[1] *= 180 / 400
        context = region_of(scene, (400, 400), window=window)
        rect, camera = look(context, depsgraph, np.eye(4))
        assert rect == Rect(40, 110, 320, 180)
        exact = read_camera(depsgraph).scaled(320, 180)
        np.testing.assert_allclose(camera.intrinsics, exact.intrinsics, atol=1e-3)

    def test_a_scaled_root_is_seen_from_where_it_is_seen_in_a_render(self, environment):
        root = environment.playable_environment.root
        root.scale, root.location, root.rotation_euler = (2, 2, 2), (1, 2, 0.5), (0, 0, 0.7)
        environment.view_layers[0].update()
        depsgraph = environment.view_layers[0].depsgraph
        inverse = inverse_of(np.array(root.matrix_world, np.float64))
        _, camera = look(region_of(environment), depsgraph, inverse)
        exact = read_camera(depsgraph).scaled(320, 180)
        np.testing.assert_allclose(
            camera.world_from_camera, exact.world_from_camera, rtol=1e-5, atol=1e-5
        )

    def test_a_local_camera_is_looked_through_instead_of_the_scenes(self, scene):
        other = bpy.data.objects.new("Other", bpy.data.cameras.new("Other"))
        scene.collection.objects.link(other)
        other.location, other.data.lens = (0, -4, 1), 20
        other.rotation_euler = (1.4, 0, 0)
        scene.view_layers[0].update()
        depsgraph = scene.view_layers[0].depsgraph
        _, camera = look(region_of(scene, camera=other), depsgraph, np.eye(4))
        scene.camera = other
        scene.view_layers[0].update()
        exact = read_camera(depsgraph).scaled(320, 180)
        np.testing.assert_allclose(camera.intrinsics, exact.intrinsics, atol=1e-3)
        np.testing.assert_allclose(camera.world_from_camera, exact.world_from_camera, atol=1e-6)

    def test_a_camera_that_is_no_pinhole_is_refused_by_its_own_name(self, scene):
        scene.camera.data.type = "ORTHO"
        scene.view_layers[0].update()
        depsgraph = scene.view_layers[0].depsgraph
        with pytest.raises(CameraError, match="ORTHO"):
            look(region_of(scene), depsgraph, np.eye(4))


def test_words_stand_above_the_panel_of_the_last_operator():
    window = SimpleNamespace(type="WINDOW", x=60, y=95, width=961, height=824)
    panel = SimpleNamespace(type="HUD", x=65, y=100, width=168, height=25)
    assert covered_bottom(SimpleNamespace(regions=[window, panel]), window) == 30
    hidden = SimpleNamespace(type="HUD", x=0, y=0, width=168, height=25)
    empty = SimpleNamespace(type="HUD", x=60, y=95, width=1, height=1)
    for each in (hidden, empty):
        assert covered_bottom(SimpleNamespace(regions=[window, each]), window) == 0
