"""The scene `duel`: a court and two blocky people, built in Blender and keyed frame by frame.

The sequence number and the seed decide everything: the same pair gives the same scene in every
process. World: metres, Z up; frames run from 1.
"""

from itertools import pairwise

import bpy
import numpy as np
from mathutils import Matrix

from blender_addon.datagen.appearance import Surroundings, draw_outfits, draw_surroundings
from blender_addon.datagen.materials import Palette, forbid_bounces, make_sky
from blender_addon.datagen.motion import (
    ACTIONS,
    FRAMES,
    PLAYERS,
    STEPS_PER_SECOND,
    Motion,
    draw_sequence,
)
from blender_addon.datagen.people import Person, build_person, key_person
from blender_addon.datagen.recordable import PLAYABLE, VIEW, Recordable
from blender_addon.datagen.viewpoints import Viewpoint, camera_axes

GROUND_X, GROUND_Y = (-14.0, 14.0), (-12.0, 9.0)
WALL_Y, WALL_TOP = 9.0, 3.5
SUN_TILT = np.radians(15.0)
SUN_SHARE = 0.42  # of the light on a floor; the rest is the materials' own glow

# Service-box-like court: outer edges and the lines inside it, centre lines in metres.
_COURT_X, _COURT_Y = 4.2, (-4.6, 4.6)
_SERVICE_Y = (-2.2, 2.2)
_LINE = 0.10
_PANELS = ((-11.0, -7.0), (-4.5, -1.0), (1.5, 5.0), (7.5, 11.0))
_PANEL_Z = (0.6, 2.7)


def build_duel(seed: int, sequence: int) -> Recordable:
    """Empty Blender and build one sequence of `duel` in it."""
    plan = draw_sequence(seed, sequence)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, FRAMES
    scene.render.fps = round(STEPS_PER_SECOND)
    colours = draw_surroundings(plan.rng)
    palette = Palette()
    _build_court(scene, palette, colours)
    make_sky(scene, colours.horizon, colours.zenith)
    _build_sun(scene, plan.rng)
    outfits = draw_outfits(plan.rng, len(PLAYERS))
    for index, (name, outfit) in enumerate(zip(PLAYERS, outfits, strict=True)):
        person = build_person(scene, name, outfit, palette)
        person.root[PLAYABLE] = name
        _key_motion(person, plan.motion, index)
    for number, path in enumerate(plan.views):
        _build_camera(scene, f"camera_{number}", number, path)
    forbid_bounces(scene)
    return Recordable(scene, "duel", ACTIONS, STEPS_PER_SECOND)


def _key_motion(person: Person, motion: Motion, index: int) -> None:
    frames = len(motion.positions)
    for t in range(frames):
        action = motion.actions[min(t, frames - 2), index]
        key_person(person, t + 1, motion.positions[t, index], motion.gaits[index], int(action))


def _build_court(scene: bpy.types.Scene, palette: Palette, colours: Surroundings) -> None:
    upright = [(x, *_COURT_Y) for x in (-_COURT_X, _COURT_X)] + [(0.0, *_SERVICE_Y)]
    across = [(y, -_COURT_X, _COURT_X) for y in (*_COURT_Y, *_SERVICE_Y)]
    half = _LINE / 2
    lines = [(x - half, x + half, low - half, high + half) for x, low, high in upright]
    lines += [(low - half, high + half, y - half, y + half) for y, low, high in across]
    floor = [(-_COURT_X, _COURT_X, *_COURT_Y)]
    groups = [(lines, colours.line), (floor, colours.inner)]
    ground = _tiled_mesh("ground", GROUND_X, GROUND_Y, groups, colours.outer, palette)
    scene.collection.objects.link(ground)

    groups = [
        ([(*panel, *_PANEL_Z)], colours.panels[k % len(colours.panels)])
        for k, panel in enumerate(_PANELS)
    ]
    wall = _tiled_mesh("wall", GROUND_X, (0.0, WALL_TOP), groups, colours.wall, palette)
    # The mesh is drawn flat; standing it up turns its +Z towards the cameras at -Y.
    wall.rotation_euler.x = np.pi / 2
    wall.location.y = WALL_Y
    scene.collection.objects.link(wall)


def _tiled_mesh(
    name: str,
    span_x: tuple[float, float],
    span_y: tuple[float, float],
    groups: list,
    rest: tuple[float, float, float],
    palette: Palette,
) -> bpy.types.Object:
    """One flat rectangle in the xy plane, cut so that every coloured rectangle is whole tiles.

    `groups` lists (rectangles as (x0, x1, y0, y1), colour), the first match wins; tiles in none
    are painted `rest`. Cutting keeps the surface truly flat: nothing lies on top of it.
    """
    rectangles = [r for group, _ in groups for r in group]
    xs = sorted({*span_x, *(v for r in rectangles for v in r[:2])})
    ys = sorted({*span_y, *(v for r in rectangles for v in r[2:])})
    corners = [(x, y, 0.0) for y in ys for x in xs]
    faces, slots = [], []
    for j, (y0, y1) in enumerate(pairwise(ys)):
        for i, (x0, x1) in enumerate(pairwise(xs)):
            k = j * len(xs) + i
            faces.append((k, k + 1, k + 1 + len(xs), k + len(xs)))
            slots.append(_group_at(groups, (x0 + x1) / 2, (y0 + y1) / 2))
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    for colour in [*(colour for _, colour in groups), rest]:
        mesh.materials.append(palette.flat(colour))
    mesh.polygons.foreach_set("material_index", slots)
    return bpy.data.objects.new(name, mesh)


def _group_at(groups: list, x: float, y: float) -> int:
    for index, (rectangles, _) in enumerate(groups):
        if any(x0 < x < x1 and y0 < y < y1 for x0, x1, y0, y1 in rectangles):
            return index
    return len(groups)


def _build_sun(scene: bpy.types.Scene, rng: np.random.Generator) -> None:
    light = bpy.data.lights.new("sun", "SUN")
    light.angle = 0.0
    light.energy = SUN_SHARE * np.pi
    sun = bpy.data.objects.new("sun", light)
    turn, tilt = rng.uniform(0, 2 * np.pi), rng.uniform(0, SUN_TILT)
    sun.rotation_euler = (tilt, 0.0, turn)
    scene.collection.objects.link(sun)


def _build_camera(scene: bpy.types.Scene, name: str, number: int, path: list[Viewpoint]) -> None:
    data = bpy.data.cameras.new(name)
    data.sensor_fit = "HORIZONTAL"
    data.angle = path[0].field_of_view
    camera = bpy.data.objects.new(name, data)
    camera[VIEW] = number
    camera.rotation_mode = "QUATERNION"
    scene.collection.objects.link(camera)
    if number == 0:
        scene.camera = camera
    for frame, view in enumerate(path, start=1):
        pose = np.eye(4)
        # Blender's camera looks down -Z with Y up; ours down +Z with Y down.
        pose[:3, :3] = camera_axes(view) @ np.diag([1.0, -1.0, -1.0])
        pose[:3, 3] = view.eye
        camera.matrix_world = Matrix(pose.tolist())
        camera.keyframe_insert("location", frame=frame)
        camera.keyframe_insert("rotation_quaternion", frame=frame)
