"""Lines, dots and names on the screen: all that knows of the graphics card."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import blf
import bpy
import gpu
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix, Vector

from .placed_labels import PADDING, Words, inside, readable
from .scene_lines import Label, SceneLines

FONT = 0
TEXT_SIZE = 11.0
LINE_HEIGHT = 1.35
OFFSET = 6
"""Pixels from an anchor to its words."""
CASING, SHADE = 2.0, np.array([0.0, 0.0, 0.0, 0.45])
"""How much wider the dark line under a line is, and how much of the line's opacity it has."""
BACKDROP = (0.05, 0.05, 0.06, 0.66)


@dataclass(frozen=True)
class Batches:
    """What the graphics card holds of a SceneLines.

    Attributes:
        lines: Width and batch.
        dots: Size and batch.
        labels: As they were.
    """

    lines: Sequence[tuple[float, gpu.types.GPUBatch]]
    dots: Sequence[tuple[float, gpu.types.GPUBatch]]
    labels: Sequence[Label]


def batches_of(lines: SceneLines) -> Batches:
    """Hand lines and dots to the graphics card, one batch for each width and size."""
    by_width, by_size = defaultdict(list), defaultdict(list)
    for each in lines.strokes:
        if len(each.ends):
            ends, colours = each.ends.reshape(-1, 3), each.colours.repeat(2, axis=0)
            by_width[each.width + CASING].append((ends, colours * SHADE))
            by_width[each.width].append((ends, colours))
    for each in lines.dots:
        if len(each.points):
            by_size[each.size].append((each.points, each.colours))
    # The widest first: they are the casings that set the others off from bright pictures.
    widths = sorted(by_width.items(), reverse=True)
    line_batches = [(w, _batch("POLYLINE_FLAT_COLOR", "LINES", p)) for w, p in widths]
    dot_batches = [(s, _batch("POINT_FLAT_COLOR", "POINTS", p)) for s, p in by_size.items()]
    return Batches(line_batches, dot_batches, lines.labels)


def draw_lines(batches: Batches, region: bpy.types.Region, world: Matrix, scale: float) -> None:
    """Draw lines and dots in a region; to be called while its view is set up.

    Args:
        batches: What is drawn, in environment space.
        region: The viewport's.
        world: From environment space to the scene's.
        scale: Of the user interface.
    """
    with _see_through(), gpu.matrix.push_pop():
        gpu.matrix.multiply_matrix(world)
        shader = gpu.shader.from_builtin("POLYLINE_FLAT_COLOR")
        shader.bind()
        shader.uniform_float("viewportSize", (region.width, region.height))
        for width, batch in batches.lines:
            shader.uniform_float("lineWidth", width * scale)
            batch.draw(shader)
        shader = gpu.shader.from_builtin("POINT_FLAT_COLOR")
        for size, batch in batches.dots:
            gpu.state.point_size_set(size * scale)
            batch.draw(shader)


def draw_labels(
    labels: Sequence[Label],
    region: bpy.types.Region,
    view: bpy.types.RegionView3D,
    world: Matrix,
    scale: float,
) -> None:
    """Write names beside their points, as many as can be read; in pixels of a region."""
    blf.size(FONT, TEXT_SIZE * scale)
    seen = [
        (label, spot)
        for label in labels
        if (spot := location_3d_to_region_2d(region, view, world @ Vector(label.anchor)))
        and 0 <= spot.x <= region.width
        and 0 <= spot.y <= region.height
    ]
    words = [_words(label, spot, region, scale) for label, spot in seen]
    with _see_through():
        for index in readable(words):
            _write(seen[index][0], words[index], scale)


def _words(label: Label, spot: Vector, region: bpy.types.Region, scale: float) -> Words:
    lines = label.text.split("\n")
    width = max(blf.dimensions(FONT, line)[0] for line in lines)
    height = len(lines) * TEXT_SIZE * LINE_HEIGHT * scale
    words = Words(spot.x + OFFSET * scale, spot.y + OFFSET * scale, width, height, label.rank)
    return inside(words, region.width, region.height)


def _write(label: Label, words: Words, scale: float) -> None:
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    left, right = words.left - PADDING, words.left + words.width + PADDING
    low, high = words.bottom - PADDING, words.bottom + words.height + PADDING
    corners = [(left, low), (right, low), (left, high), (right, high)]
    backdrop = batch_for_shader(shader, "TRI_STRIP", {"pos": corners})
    shader.bind()
    shader.uniform_float("color", BACKDROP)
    backdrop.draw(shader)
    blf.color(FONT, *label.colour)
    step = TEXT_SIZE * LINE_HEIGHT * scale
    for row, line in enumerate(reversed(label.text.split("\n"))):
        blf.position(FONT, words.left, words.bottom + row * step + PADDING * scale, 0.0)
        blf.draw(FONT, line)


def _batch(shader: str, kind: str, parts: Sequence[tuple]) -> gpu.types.GPUBatch:
    points, colours = (np.concatenate(each).astype(np.float32) for each in zip(*parts, strict=True))
    content = {"pos": points, "color": colours}
    return batch_for_shader(gpu.shader.from_builtin(shader), kind, content)


@contextmanager
def _see_through() -> Iterator[None]:
    """Blend over everything that is there, and leave the card's state as it was."""
    before = gpu.state.blend_get(), gpu.state.depth_test_get(), gpu.state.depth_mask_get()
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("NONE")
    gpu.state.depth_mask_set(False)
    try:
        yield
    finally:
        gpu.state.blend_set(before[0])
        gpu.state.depth_test_set(before[1])
        gpu.state.depth_mask_set(before[2])
        gpu.state.point_size_set(1.0)
