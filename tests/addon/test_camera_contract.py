"""The camera contract: where the add-on says that a point is, Cycles draws it.

Cycles draws the inside of a box whose every point glows in the colour of its own position, one
sample per pixel. Projected through the add-on's camera, what a pixel shows must lie at its centre.
"""

import numpy as np
import OpenImageIO as oiio  # noqa: N813 its own documentation's name
import pytest

from pe_runtime.contract.camera import project

bpy = pytest.importorskip("bpy")
pytestmark = pytest.mark.blender

from mathutils import Euler, Matrix  # noqa: E402

from blender_addon.scene_bridge import read_camera, world_from_environment  # noqa: E402

CAMERAS, BATCHES = 200, 10
TOLERANCE_PIXELS = 0.01
ROOM = 10.0
"""Half the edge of the box, metres."""
LIFT = 2 * ROOM
"""Keeps colours above zero."""
FITS = ("AUTO", "HORIZONTAL", "VERTICAL")


@pytest.fixture
def glowing_room(addon):
    scene = bpy.data.scenes[0]
    bpy.ops.mesh.primitive_cube_add(size=2 * ROOM)
    material = bpy.data.materials.new("Position")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    place, lift = nodes.new("ShaderNodeNewGeometry"), nodes.new("ShaderNodeVectorMath")
    glow, out = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    lift.inputs[1].default_value = LIFT, LIFT, LIFT
    links.new(place.outputs["Position"], lift.inputs[0])
    links.new(lift.outputs["Vector"], glow.inputs["Color"])
    links.new(glow.outputs["Emission"], out.inputs["Surface"])
    bpy.context.object.data.materials.append(material)
    scene.render.engine, scene.cycles.samples, scene.cycles.filter_width = "CYCLES", 1, 0.01
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.max_bounces = 0
    scene.render.use_persistent_data = True
    output = scene.render.image_settings
    output.file_format, output.color_depth = "OPEN_EXR", "32"
    holder = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    root = bpy.data.objects.new("Root", None)
    scene.collection.objects.link(holder)
    scene.collection.objects.link(root)
    scene.camera, scene.playable_environment.root = holder, root
    return scene


def chosen(draw, *values):
    return values[draw.integers(len(values))]


def shake(scene, draw):
    """Give the scene a random camera, output and environment root."""
    render, holder = scene.render, scene.camera
    lens = holder.data
    lens.sensor_fit = chosen(draw, *FITS)
    lens.sensor_width, lens.sensor_height = draw.uniform(5, 60, 2)
    lens.lens = float(10 ** draw.uniform(0.8, 2.2))
    lens.shift_x, lens.shift_y = draw.uniform(-0.6, 0.6, 2) * draw.integers(2, size=2)
    render.resolution_x, render.resolution_y = (int(n) for n in draw.integers(20, 140, 2))
    render.resolution_percentage = chosen(draw, 100, 100, 33, 57, 75)
    aspect = 1.0, float(draw.uniform(1, 2))
    render.pixel_aspect_x, render.pixel_aspect_y = chosen(draw, (1, 1), aspect, aspect[::-1])
    render.use_border, render.use_crop_to_border = (bool(n) for n in draw.integers(2, size=2))
    left, bottom = draw.uniform(0, 0.6, 2)
    render.border_min_x, render.border_min_y = left, bottom
    render.border_max_x, render.border_max_y = draw.uniform((left + 0.3, bottom + 0.3), 1)
    place, turn = draw.uniform(-ROOM / 3, ROOM / 3, 3), Euler(draw.uniform(-3, 3, 3))
    size = float(10 ** draw.uniform(-0.7, 0.7))
    holder.matrix_world = (
        Matrix.Translation(place) @ turn.to_matrix().to_4x4() @ Matrix.Scale(size, 4)
    )
    root = scene.playable_environment.root
    root.location, root.rotation_euler = draw.uniform(-3, 3, 3), draw.uniform(-3, 3, 3)
    root.scale = (float(10 ** draw.uniform(-1, 1)),) * 3


def positions(path):
    """(height, width, 3) float32 world positions that a render shows, top row first."""
    return np.asarray(oiio.ImageInput.open(str(path)).read_image(oiio.FLOAT))[..., :3] - LIFT


def offset_of(scene, shape, camera):
    """Column and row of the picture's first pixel on the camera's grid, and the part it covers."""
    render = scene.render
    if not render.use_border:
        return (0, 0), slice(None), slice(None)
    left = int(render.border_min_x * camera.width)
    right = int(render.border_max_x * camera.width)
    bottom = int(render.border_min_y * camera.height)
    top = int(render.border_max_y * camera.height)
    if render.use_crop_to_border:
        return (left, camera.height - top), slice(None), slice(None)
    rows, columns = slice(camera.height - top, camera.height - bottom), slice(left, right)
    return (left, camera.height - top), rows, columns


@pytest.mark.parametrize("seed", range(BATCHES))
def test_points_lie_where_cycles_draws_them_for_every_kind_of_camera(glowing_room, tmp_path, seed):
    scene, draw, worst = glowing_room, np.random.default_rng(seed), 0.0
    for number in range(CAMERAS // BATCHES):
        shake(scene, draw)
        path = tmp_path / f"{number}.exr"
        scene.render.filepath = str(path)
        bpy.ops.render.render(write_still=True)
        layer = scene.view_layers[0]
        layer.update()
        camera = read_camera(layer.depsgraph)
        drawn = positions(path)
        (left, top), rows, columns = offset_of(scene, drawn.shape, camera)
        drawn = drawn[rows, columns]
        points = drawn.reshape(-1, 3).astype(np.float64)
        environment_from_world = np.linalg.inv(world_from_environment(layer.depsgraph))
        points = points @ environment_from_world[:3, :3].T + environment_from_world[:3, 3]
        pixels, depths = project(camera, points)
        height, width = drawn.shape[:2]
        centres = np.mgrid[:height, :width][::-1].reshape(2, -1).T + 0.5 + (left, top)
        assert (depths > 0).all()
        worst = max(worst, float(np.abs(pixels - centres).max()))
    assert worst <= TOLERANCE_PIXELS
