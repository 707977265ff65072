"""Our lens arithmetic against Blender's own projection matrix."""

import math
import random

import numpy as np
import pytest

from pe_runtime.contract.camera import BlenderLens, camera_from_blender

pytestmark = pytest.mark.blender
bpy = pytest.importorskip("bpy")
CAMERAS = 400
TOLERANCE = 1e-5


@pytest.fixture
def scene():
    """A scene of our own, removed afterwards, so that no other test sees its cameras."""
    made = bpy.data.scenes.new("camera laws")
    yield made
    for ob in list(made.collection.objects):
        bpy.data.objects.remove(ob)
    bpy.data.scenes.remove(made)


def random_render_settings(rng, render):
    render.resolution_x, render.resolution_y = rng.randint(4, 4000), rng.randint(4, 4000)
    render.resolution_percentage = rng.choice([100, 100, 50, 33, 67, 99, 150])
    render.pixel_aspect_x, render.pixel_aspect_y = rng.choice(
        [(1, 1), (1, 1), (2, 1), (1, 2), (1.0667, 1), (rng.uniform(1, 3), rng.uniform(1, 3))]
    )


def random_camera_data(rng):
    data = bpy.data.cameras.new("law")
    data.lens = rng.uniform(5, 200)
    data.sensor_width, data.sensor_height = rng.uniform(5, 60), rng.uniform(5, 60)
    data.sensor_fit = rng.choice(["AUTO", "HORIZONTAL", "VERTICAL"])
    if rng.random() < 0.5:
        data.shift_x, data.shift_y = rng.uniform(-1, 1), rng.uniform(-1, 1)
    return data


def random_camera_object(rng, scene):
    """Scaled, and half of the time parented to a turned, evenly scaled Empty."""
    camera = bpy.data.objects.new("law", random_camera_data(rng))
    scene.collection.objects.link(camera)
    camera.rotation_euler = [rng.uniform(-math.pi, math.pi) for _ in range(3)]
    camera.location = [rng.uniform(-20, 20) for _ in range(3)]
    camera.scale = [rng.uniform(0.1, 9) for _ in range(3)]
    if rng.random() < 0.5:
        parent = bpy.data.objects.new("law parent", None)
        scene.collection.objects.link(parent)
        parent.rotation_euler = [rng.uniform(-math.pi, math.pi) for _ in range(3)]
        parent.location = [rng.uniform(-20, 20) for _ in range(3)]
        parent.scale = [rng.uniform(0.2, 5)] * 3
        camera.parent = parent
    return camera


def lens_of(data, render):
    camera_names = ("type", "lens", "sensor_width", "sensor_height", "sensor_fit")
    shift_names = ("shift_x", "shift_y")
    render_names = ("resolution_x", "resolution_y", "resolution_percentage")
    aspect_names = ("pixel_aspect_x", "pixel_aspect_y")
    return BlenderLens(
        **{name: getattr(data, name) for name in camera_names + shift_names},
        **{name: getattr(render, name) for name in render_names + aspect_names},
    )


def opengl_clip(intrinsics, width, height):
    """The x and y rows of a clip matrix that a pinhole with these intrinsics would have."""
    (fx, _, cx), (_, fy, cy), _ = intrinsics
    return np.array(
        [
            [2 * fx / width, 0, 1 - 2 * cx / width, 0],
            [0, 2 * fy / height, 2 * cy / height - 1, 0],
        ]
    )


def test_four_hundred_random_cameras_project_as_blender_does(scene):
    rng = random.Random(7)
    portrait = parented = 0
    cameras = [random_camera_object(rng, scene) for _ in range(CAMERAS)]
    scene.view_layers[0].update()
    depsgraph = scene.view_layers[0].depsgraph
    for camera in cameras:
        random_render_settings(rng, scene.render)
        evaluated = camera.evaluated_get(depsgraph)
        ours = camera_from_blender(
            lens_of(evaluated.data, scene.render), np.array(evaluated.matrix_world)
        )
        portrait += ours.height > ours.width
        parented += camera.parent is not None
        compare_projections(ours, evaluated, depsgraph, scene.render)
    assert portrait > 50
    assert parented > 100


def compare_projections(ours, evaluated, depsgraph, render):
    theirs = np.array(
        evaluated.calc_matrix_camera(
            depsgraph,
            x=ours.width,
            y=ours.height,
            scale_x=render.pixel_aspect_x,
            scale_y=render.pixel_aspect_y,
        )
    )[:2]
    clip = opengl_clip(ours.intrinsics, ours.width, ours.height)
    focal = ([0, 1], [0, 1])
    np.testing.assert_allclose(clip[focal], theirs[focal], rtol=TOLERANCE)
    # A centred lens puts zeros here: errors are shares of half the frame.
    np.testing.assert_allclose(clip[:, 2], theirs[:, 2], rtol=TOLERANCE, atol=TOLERANCE)
    assert not theirs[[0, 1, 0, 1], [1, 0, 3, 3]].any()
    axes = np.array(evaluated.matrix_world.normalized())
    np.testing.assert_allclose(
        ours.world_from_camera @ np.diag([1, -1, -1, 1]), axes, rtol=TOLERANCE, atol=TOLERANCE
    )


def test_blender_truncates_the_percentage_of_the_resolution_as_we_do(scene, tmp_path):
    scene.render.resolution_x, scene.render.resolution_y = 101, 99
    scene.render.resolution_percentage = 33
    data = bpy.data.cameras.new("law")
    ours = camera_from_blender(lens_of(data, scene.render), np.eye(4))
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.camera = bpy.data.objects.new("law", data)
    scene.collection.objects.link(scene.camera)
    scene.render.filepath = str(tmp_path / "frame.png")
    bpy.ops.render.render(write_still=True, scene=scene.name)
    written = bpy.data.images.load(scene.render.filepath)
    assert tuple(written.size) == (ours.width, ours.height)
    bpy.data.images.remove(written)
