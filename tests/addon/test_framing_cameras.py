"""The picture's camera: matched to points of the ground, chosen among the scene's, or usual."""

import dataclasses
import json

import numpy as np
import pytest
from addon.stage import BOXES, HEIGHT, WIDTH, front_camera, opened_picture, picture_of

bpy = pytest.importorskip("bpy")
from mathutils import Vector  # noqa: E402 - after the check for Blender

from blender_addon.framing.cameras import (  # noqa: E402
    matched_camera,
    own_camera,
    seen_by,
)
from blender_addon.framing.framed import framed_picture  # noqa: E402
from blender_addon.framing.showing import picture_in_view, placeholder  # noqa: E402
from blender_addon.pictures import write_picture  # noqa: E402
from blender_addon.scene_bridge import look_through, playable_objects  # noqa: E402
from pe_runtime.contract.camera import project  # noqa: E402
from pe_runtime.contract.errors import CameraError  # noqa: E402

pytestmark = pytest.mark.blender
GROUND = ((-3.0, -2.0), (3.0, -2.0), (3.0, 4.0), (-3.0, 4.0), (0.5, 1.0))


def pixel_of(place, camera=None):
    pixel, _ = project(camera or front_camera(), np.array([[*place, 0.0]]))
    return tuple(map(float, pixel[0]))


@pytest.fixture
def framing(scene, picture):
    """The scene's framing settings, with the fake model and the picture's file."""
    settings = scene.playable_environment
    settings.model, settings.image_path = "fake", str(picture)
    return settings.framing


def place_points(places=GROUND, off=(0.0, 0.0)):
    for place in places:
        u, v = pixel_of(place)
        bpy.ops.playable.place_ground_points(pixel=(u + off[0], v + off[1]), place=place)
        off = (0.0, 0.0)


def make(**options):
    bpy.ops.playable.new_environment(boxes=json.dumps(BOXES), **options)


def test_a_camera_is_matched_to_points_of_the_ground(scene, framing):
    place_points()
    bpy.ops.playable.match_camera()
    found = matched_camera(scene, (WIDTH, HEIGHT))
    np.testing.assert_allclose(found.world_from_camera[:3, 3], (0.0, -8.0, 2.5), atol=0.02)
    assert 0 <= framing.residual < 0.05 and framing.camera_mode == "MATCH"
    assert all(0 <= each.miss < 0.1 for each in framing.points)
    assert scene.camera == framing.own_camera
    assert (scene.render.resolution_x, scene.render.resolution_y) == (WIDTH, HEIGHT)
    bpy.context.view_layer.update()
    held = seen_by(scene.camera, scene.render, np.eye(4), (WIDTH, HEIGHT))
    np.testing.assert_allclose(held.intrinsics, found.intrinsics, rtol=1e-6)
    np.testing.assert_allclose(held.world_from_camera, found.world_from_camera, atol=1e-5)


def test_the_matched_camera_shows_the_picture_behind_the_view(scene, framing):
    place_points()
    bpy.ops.playable.match_camera()
    (shown,) = scene.camera.data.background_images
    assert shown.image == framing.backdrop and shown.frame_method == "STRETCH"
    assert scene.camera.data.show_background_images and shown.display_depth == "BACK"


def test_a_bad_point_is_seen_by_its_residual_and_said(scene, framing, capfd):
    place_points(off=(4.0, -3.0))
    bpy.ops.playable.match_camera()
    misses = [each.miss for each in framing.points]
    assert framing.residual > 0.3 and max(misses) > 0.5
    assert f"residual {framing.residual:.2f} px" in capfd.readouterr().out


def test_moving_a_point_makes_the_match_stale_and_a_new_environment_matches_again(scene, framing):
    place_points()
    bpy.ops.playable.match_camera()
    first = matched_camera(scene, (WIDTH, HEIGHT))
    framing.points[0].pixel[0] += 1.0
    assert matched_camera(scene, (WIDTH, HEIGHT)) is None
    make(camera="MATCH")
    again = matched_camera(scene, (WIDTH, HEIGHT))
    assert again is not None and again != first
    assert opened_picture(scene).camera == again


def test_an_environment_from_a_match_stands_where_the_matched_camera_sees_it(scene, framing):
    place_points()
    make(camera="MATCH")
    foot = playable_objects(scene)["player_1"].location
    left, _, right, bottom = BOXES["player_1"]
    assert pixel_of(foot[:2]) == pytest.approx(((left + right) / 2, bottom), abs=0.2)
    assert scene.camera == framing.own_camera


def test_fewer_than_four_points_are_refused_with_what_to_do(scene, framing):
    place_points(GROUND[:3])
    with pytest.raises(RuntimeError, match="Place 4 or more points of the ground first"):
        bpy.ops.playable.match_camera()
    with pytest.raises(RuntimeError, match="needs 4 or more points of the ground, 3 placed"):
        make(camera="MATCH")


def test_a_known_lens_is_kept(scene, framing):
    place_points()
    framing.is_lens_known = True
    framing.field_of_view = 2 * np.arctan(0.5)
    bpy.ops.playable.match_camera()
    found = matched_camera(scene, (WIDTH, HEIGHT))
    assert found.intrinsics[0, 0] == pytest.approx(WIDTH, rel=1e-6)


def test_a_camera_that_films_by_now_is_left_alone_by_another_match(scene, framing):
    place_points()
    bpy.ops.playable.match_camera()
    film = framing.own_camera
    film.keyframe_insert("location", frame=1)
    before = film.matrix_world.copy()
    assert own_camera(scene) is None
    framing.points[0].pixel[0] += 1.0
    bpy.ops.playable.match_camera()
    assert framing.own_camera != film and film.matrix_world == before


def test_matching_again_changes_the_same_camera(scene, framing):
    place_points()
    for _ in range(2):
        bpy.ops.playable.match_camera()
        framing.points[0].pixel[0] += 0.5
    assert [each.name for each in bpy.data.cameras].count("Environment Camera") == 1


def test_any_camera_of_the_scene_can_have_seen_the_picture(scene, framing):
    other = bpy.data.objects.new("solved", bpy.data.cameras.new("solved"))
    scene.collection.objects.link(other)
    side = front_camera()
    pose = side.world_from_camera.copy()
    pose[0, 3] = 1.0
    look_through(other, scene.render, dataclasses.replace(side, world_from_camera=pose))
    framing.camera_mode, framing.camera = "SCENE", other
    make(camera="SCENE")
    assert opened_picture(scene).camera.world_from_camera[0, 3] == 1.0
    assert scene.camera == other


def test_a_camera_moved_by_a_constraint_is_taken_where_it_is(scene, framing):
    anchor = bpy.data.objects.new("solver", None)
    scene.collection.objects.link(anchor)
    anchor.location = (2.0, -8.0, 2.5)
    follow = scene.camera.constraints.new("COPY_LOCATION")
    follow.target = anchor
    make()
    seen = opened_picture(scene).camera
    assert seen.world_from_camera[:3, 3] == pytest.approx((2.0, -8.0, 2.5))


def test_a_picture_of_another_shape_is_refused_and_one_button_helps(scene, framing, tmp_path):
    write_picture(tmp_path / "square.png", picture_of(40, 40))
    scene.playable_environment.image_path = str(tmp_path / "square.png")
    framing.camera_mode = "SCENE"
    with pytest.raises(RuntimeError, match=r"renders 64 x 36, the picture is 40 x 40: press Use"):
        make()
    assert "press Use Picture Size" in framed_picture(scene).trouble
    bpy.ops.playable.use_picture_size()
    assert (scene.render.resolution_x, scene.render.resolution_y) == (40, 40)
    bpy.ops.playable.new_environment(boxes=json.dumps({"player_1": BOXES["player_1"]}))
    with pytest.raises(RuntimeError, match="has its shape"):
        bpy.ops.playable.use_picture_size()


def test_oblong_pixels_count_for_the_shape_of_the_frame(scene):
    scene.render.resolution_x, scene.render.pixel_aspect_x = 32, 2.0
    seen = seen_by(scene.camera, scene.render, np.eye(4), (WIDTH, HEIGHT))
    assert (seen.width, seen.height) == (WIDTH, HEIGHT)
    scene.render.pixel_aspect_x = 1.0
    with pytest.raises(CameraError, match="renders 32 x 36"):
        seen_by(scene.camera, scene.render, np.eye(4), (WIDTH, HEIGHT))


def test_looking_at_the_picture_makes_a_camera_for_it_before_anything_is_encoded(scene, framing):
    bpy.ops.playable.load_model()
    bpy.ops.playable.show_picture()
    assert scene.camera == framing.own_camera
    np.testing.assert_allclose(
        np.array(scene.camera.matrix_world)[:3, 3], (0.0, -8.0, 2.5), atol=1e-6
    )
    framing.camera_mode = "MATCH"
    framing.own_camera = None
    bpy.ops.playable.show_picture()
    expected = placeholder((WIDTH, HEIGHT)).world_from_camera[:3, 3]
    np.testing.assert_allclose(np.array(scene.camera.matrix_world)[:3, 3], expected, atol=1e-6)


def test_framing_again_leaves_the_films_camera_and_size_alone(environment):
    film = environment.camera
    environment.render.resolution_x, environment.render.resolution_y = 128, 72
    environment.playable_environment.framing.camera_mode = "USUAL"
    bpy.ops.playable.show_picture()
    assert environment.camera == film
    assert (environment.render.resolution_x, environment.render.resolution_y) == (128, 72)
    assert environment.playable_environment.framing.own_camera != film


def test_points_get_the_places_that_the_model_knows(scene, framing):
    bpy.ops.playable.load_model()
    bpy.ops.playable.add_ground_point()
    bpy.ops.playable.use_landmark(landmark="ground: far left")
    point = framing.points[0]
    assert (point.name, tuple(point.place)) == ("ground: far left", (-14.0, 9.0))
    assert not point.is_placed and framing.placed_points() == []


def test_points_are_added_corrected_and_taken_away(scene, framing):
    place_points(GROUND[:2])
    assert [each.name for each in framing.points] == ["Point 1", "Point 2"]
    bpy.ops.playable.place_ground_points(index=0, pixel=(3, 4))
    assert tuple(framing.points[0].pixel) == (3, 4)
    assert tuple(framing.points[0].place) == GROUND[0]
    bpy.ops.playable.remove_ground_point(index=0)
    bpy.ops.playable.add_ground_point()
    assert [each.name for each in framing.points] == ["Point 2", "Point 1"]
    with pytest.raises(RuntimeError, match="there is no point 7"):
        bpy.ops.playable.place_ground_points(index=7, pixel=(3, 4))


class View:
    """As much of a 3D view as the mapping looks at."""

    def __init__(self, matrix, camera=None):
        self.use_local_camera, self.camera = camera is not None, camera
        self.region_3d, self.view_perspective, self.perspective_matrix = self, "CAMERA", matrix
        self.width, self.height = 640, 360


@pytest.mark.parametrize("shift", [0.0, 0.12])
def test_the_mouse_over_blenders_own_camera_frame_is_the_pixel_below_it(scene, shift):
    holder = scene.camera
    holder.data.shift_x, holder.data.shift_y, holder.scale = shift, -shift, (2, 2, 2)
    bpy.context.view_layer.update()
    graph = bpy.context.evaluated_depsgraph_get()
    seen = seen_by(holder, scene.render, np.eye(4), (WIDTH, HEIGHT))
    projection = holder.calc_matrix_camera(graph, x=640, y=360)
    view = View(projection @ holder.matrix_world.normalized().inverted())
    frame = picture_in_view(view, view, scene, (WIDTH, HEIGHT))
    for place in GROUND:
        ndc = view.perspective_matrix @ Vector((*place, 0, 1))
        x, y = (ndc.x / ndc.w + 1) * 320, (ndc.y / ndc.w + 1) * 180
        assert frame.to_picture(x, y) == pytest.approx(pixel_of(place, seen), abs=1e-3)
    view.view_perspective = "PERSP"
    assert picture_in_view(view, view, scene, (WIDTH, HEIGHT)) is None
