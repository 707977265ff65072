"""A gold cube that passes between two players: behind the one, before the other.

    python -m blender_addon.examples.passing_cube --spec spec.json

Players and cube are scenes of their own with one camera. The compositor puts the cube's shadow on
the ground where no player's mask is, and takes per pixel whichever is nearer. The output folder
gets before/, after/, passing_cube.blend (F12 there renders it again) and blender_report.json.
"""

import argparse
import json
import math
import os
import sys
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import bpy
import numpy as np

import blender_addon
from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import PlayableEnvironmentError, ShotError

from .. import playables
from ..bake import bake_of
from ..complete_files import write_complete
from ..filming.pixels import use_exact_colours
from ..scene_bridge import action_names, look_through, playable_objects
from ..volumes import FACES
from ..worker.session import session
from .compositor import Compositor
from .demo_scene import DemoSpec, read_spec

EDGE = 0.7
"""Metres."""
REACH = 2.2
"""Metres that the cube's way is longer than the players are apart, on either side."""
WIDE = 12.0
"""Metres from the origin to where the ground that takes the shadow ends."""
GOLD = (0.8, 0.36, 0.04, 1.0)
SAMPLES = 32
SHARED = ("resolution_x", "resolution_y", "pixel_aspect_x", "pixel_aspect_y", "fps", "fps_base")


def build(spec: DemoSpec) -> tuple[bpy.types.Scene, bpy.types.Scene]:
    """The players' scene, which composes, and the cube's.

    Raises:
        PlayableEnvironmentError: The picture, the model or the worker is at fault.
    """
    players = _players(spec)
    cube = _cube_scene(players)
    names = list(playable_objects(players))
    compositor = Compositor(players)
    people = compositor.layer(players, players.view_layers[0].name)
    solid, shade = compositor.layer(cube, "Cube"), compositor.layer(cube, "Shadow")
    ground = compositor.without([people.outputs[f"Mask {name}"] for name in names])
    shaded = compositor.over(people.outputs["Image"], shade.outputs["Image"], ground)
    compositor.shows(compositor.nearest(solid, people, shaded))
    return players, cube


def film(spec: DemoSpec) -> dict[str, Any]:
    """Render the range without and with the cube; returns the files.

    Raises:
        PlayableEnvironmentError: As `build`.
        RuntimeError: A frame could not be drawn.
    """
    out = Path(spec.out).resolve()
    players, _ = build(spec)
    made = {}
    for name, composes in (("before", False), ("after", True)):
        players.render.use_compositing = composes
        players.render.filepath = str(out / name / "frame_####")
        bpy.ops.render.render(animation=True, scene=players.name)
        made[name] = [str(file) for file in sorted((out / name).glob("*.png"))]
    blend = out / "passing_cube.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    return made | {"blend": str(blend)}


def _players(spec: DemoSpec) -> bpy.types.Scene:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    blender_addon.register()
    if spec.worker:
        session.use_command(spec.worker)
    scene = bpy.data.scenes[0]
    scene.name = "Players"
    scene.frame_start, scene.frame_end = spec.frame_start, spec.frame_end
    scene.frame_set(spec.frame_start)
    scene.render.fps, scene.render.fps_base = spec.fps, 1.0
    scene.render.image_settings.file_format = "PNG"
    holder = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(holder)
    scene.camera = holder
    eye = Camera.from_dict(spec.camera, "spec: camera")
    look_through(holder, scene.render, eye.scaled(spec.width, spec.height))
    bpy.ops.playable.new_environment(
        image=str(Path(spec.image).resolve()), model=spec.model, boxes=json.dumps(spec.boxes)
    )
    scene.playable_environment.quality = spec.quality
    scene.view_layers[0].use_pass_z = True
    for each in playable_objects(scene).values():
        each.playable.use_mask = True
        waving = [n for n, name in enumerate(action_names(each)) if name == "raise_arm"]
        for number in waving[:1]:
            playables.key_action(each, spec.frame_start, number)
    bpy.ops.playable.bake_paths()
    return scene


def _cube_scene(players: bpy.types.Scene) -> bpy.types.Scene:
    """The cube, its shadow on the ground, and light, seen by the players' camera."""
    scene = bpy.data.scenes.new("Cube")
    scene.camera = players.camera
    scene.collection.objects.link(players.camera)
    scene.frame_start, scene.frame_end = players.frame_start, players.frame_end
    for name in SHARED:
        setattr(scene.render, name, getattr(players.render, name))
    use_exact_colours(scene)
    scene.render.engine, scene.render.film_transparent = "CYCLES", True
    scene.cycles.samples, scene.cycles.use_denoising = SAMPLES, False
    solid, shade = _collection(scene, "Cube"), _collection(scene, "Shadow")
    _move(_new_cube(solid), players)
    corners = [(-WIDE, -WIDE, 0.0), (WIDE, -WIDE, 0.0), (WIDE, WIDE, 0.0), (-WIDE, WIDE, 0.0)]
    ground = _new_mesh(shade, "Ground", corners, [(0, 1, 2, 3)])
    ground.is_shadow_catcher = True
    _light(scene)
    first = scene.view_layers[0]
    first.name, first.use_pass_z = "Cube", True
    second = scene.view_layers.new("Shadow")
    for each in (first, second):
        each.update()  # until then Blender 5.2 knows no collections of theirs
    first.layer_collection.children["Shadow"].exclude = True
    second.layer_collection.children["Cube"].indirect_only = True
    return scene


def _move(cube: bpy.types.Object, players: bpy.types.Scene) -> None:
    """Key the cube's way through the middle between the two players that stand farthest apart."""
    baked = bake_of(players.playable_environment).paths
    paths = np.stack([path.mean(axis=0) for path in baked.values()])
    if len(paths) < 2:
        raise ShotError("a cube passes between two players; the picture has fewer")
    eye = np.array(players.camera.matrix_world)
    along, ahead = eye[:2, 0] / np.linalg.norm(eye[:2, 0]), -eye[:2, 2]
    ahead = ahead / np.linalg.norm(ahead)
    across, depths = paths[:, :2] @ along, paths[:, :2] @ ahead
    lane = (depths.min() + depths.max()) / 2
    ends = (players.frame_start, across.min() - REACH), (players.frame_end, across.max() + REACH)
    for turn, (frame, side) in enumerate(ends):
        cube.location = (*(along * side + ahead * lane), 0.75 * EDGE)
        cube.rotation_euler = 0.3, 0.2, 0.6 + turn * math.pi / 2
        for channel in ("location", "rotation_euler"):
            cube.keyframe_insert(channel, frame=frame)


def _new_cube(collection: bpy.types.Collection) -> bpy.types.Object:
    cube = _new_mesh(collection, "Cube", [*product((-EDGE / 2, EDGE / 2), repeat=3)], FACES)
    material = bpy.data.materials.new("Gold")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = GOLD
    shader.inputs["Roughness"].default_value = 0.5
    cube.data.materials.append(material)
    return cube


def _new_mesh(
    collection: bpy.types.Collection, name: str, corners: Sequence, faces: Sequence
) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    made = bpy.data.objects.new(name, mesh)
    collection.objects.link(made)
    return made


def _collection(scene: bpy.types.Scene, name: str) -> bpy.types.Collection:
    made = bpy.data.collections.new(name)
    scene.collection.children.link(made)
    return made


def _light(scene: bpy.types.Scene) -> None:
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy, sun.data.angle = 2.0, 0.15
    sun.rotation_euler = math.radians(30), math.radians(-20), 0.0
    scene.collection.objects.link(sun)
    scene.world = bpy.data.worlds.new("Sky")
    if bpy.app.version < (5, 0, 0):
        scene.world.use_nodes = True
    sky = scene.world.node_tree.nodes["Background"]
    sky.inputs["Color"].default_value = 0.75, 0.8, 0.9, 1.0
    sky.inputs["Strength"].default_value = 0.9


def main(arguments: Sequence[str] | None = None) -> int:
    """Film the spec and write the report; returns the exit code, 1 after one clear message."""
    parser = argparse.ArgumentParser(prog="passing_cube", description=__doc__)
    parser.add_argument("--spec", type=Path, required=True)
    path = parser.parse_args(arguments).spec
    try:
        spec = read_spec(path)
        report = film(spec)
    except (PlayableEnvironmentError, RuntimeError) as error:
        sys.stderr.write(f"passing cube: {str(error).strip()}\n")
        return 1
    finally:
        session.close()
    content = json.dumps(report, indent=1).encode()
    write_complete(Path(spec.out) / "blender_report.json", content)
    return 0


if __name__ == "__main__":
    code = main()
    sys.stderr.flush()
    # Blender 4.5 as a module can wait for ever in its own exit handlers.
    os._exit(code)
