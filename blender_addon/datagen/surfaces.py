"""Flat painted surfaces, cut along their colours."""

from collections.abc import Callable
from itertools import pairwise

import bpy

from blender_addon.datagen.appearance import Colour
from blender_addon.datagen.materials import Palette


def tiled_mesh(
    name: str,
    span_x: tuple[float, float],
    span_y: tuple[float, float],
    groups: list,
    rest: Colour,
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


def add_quads(
    scene: bpy.types.Scene,
    name: str,
    quads: list[tuple[list, Colour]],
    material: Callable[[Colour], bpy.types.Material],
) -> None:
    """One mesh of coloured quadrilaterals, each (four corners (x, y, z) in metres, colour)."""
    corners = [corner for quad, _ in quads for corner in quad]
    faces = [tuple(range(4 * k, 4 * k + 4)) for k in range(len(quads))]
    slots = {colour: number for number, colour in enumerate(dict.fromkeys(c for _, c in quads))}
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    for colour in slots:
        mesh.materials.append(material(colour))
    mesh.polygons.foreach_set("material_index", [slots[colour] for _, colour in quads])
    scene.collection.objects.link(bpy.data.objects.new(name, mesh))
