"""What is drawn on a picture before it is encoded: does camera meet ground, do boxes meet players?

Boxes stand upright where their feet meet the ground, so that through the picture's camera they
frame the players, and from anywhere else one sees where the model will take them to stand.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from pe_runtime.contract.camera import Camera, project
from pe_runtime.contract.model_facts import Volume

from ..framing.warnings import foot_of
from .clipping import NEAR, depth_of, in_front, unprojected
from .ground_grid import border_lines, encloses, grid_lines, mesh_of
from .scene_lines import (
    AMBER,
    NEUTRAL,
    RED,
    Colour,
    SceneLines,
    dots,
    faded,
    joined,
    label,
    strokes,
)
from .volume_lines import volume_edges

FINE, OUTSIDE, IMPOSSIBLE = "fine", "outside", "impossible"
COLOURS: Mapping[str, Colour] = {FINE: NEUTRAL, OUTSIDE: AMBER, IMPOSSIBLE: RED}
FARTHEST = 1e4
"""Metres; a foot just under the horizon would stand at the end of the world."""
WARNING_RANK, NAME_RANK, SCALE_RANK = 0, 1, 2
"""Words about what is wrong come before plain names where there is no room for both."""
CROSS = 0.012
"""Half the size of a point's cross, as a share of the picture's height."""


@dataclass(frozen=True)
class PictureBox:
    """A box in the picture and what is to be said about it.

    Attributes:
        name: The playable object's.
        box: Left, top, right, bottom in the picture's pixels.
        verdict: `fine`; `outside` of what the model knows; `impossible`.
        warning: Why, unless it is fine.
    """

    name: str
    box: tuple[float, float, float, float]
    verdict: str = FINE
    warning: str = ""


@dataclass(frozen=True)
class GroundMark:
    """A point that the artist placed.

    Attributes:
        name: As the list of points shows it.
        pixel: Where it is in the picture.
        ground: Where that is on the ground (x, y), metres.
    """

    name: str
    pixel: tuple[float, float]
    ground: tuple[float, float]


@dataclass(frozen=True)
class PictureView:
    """A picture, its camera and what was said about it so far.

    Attributes:
        camera: In environment space, on the picture's pixels.
        boxes: Of those objects that are in the picture.
        volumes: Of the model's objects.
        ground: Lowest and highest (x, y) at which the model knows players; None: unknown.
        marks: The artist's ground points.
        verdict: Of the camera, as of a box.
        warning: What is wrong with the camera.
        is_known: Whether it is the camera that saw the picture, not only the one that one looks
            through: without it nobody knows where the ground is.
    """

    camera: Camera
    boxes: tuple[PictureBox, ...] = ()
    volumes: Mapping[str, Volume] = field(default_factory=dict)
    ground: tuple[tuple[float, float], tuple[float, float]] | None = None
    marks: tuple[GroundMark, ...] = ()
    verdict: str = FINE
    warning: str = ""
    is_known: bool = True


def ground_lines(view: PictureView) -> SceneLines:
    """The grid of the ground that the model knows, as far as it lies before the camera."""
    if not view.is_known or view.ground is None or not encloses(*view.ground):
        return SceneLines()
    low, high = view.ground
    colour = COLOURS[view.verdict]
    mesh = strokes(in_front(view.camera, grid_lines(low, high)), faded(colour, 0.35))
    border = strokes(in_front(view.camera, border_lines(low, high)), faded(colour, 0.9), 2.0)
    return joined((mesh, border, _mesh_label(view, mesh_of(low, high), colour)))


def box_lines(view: PictureView) -> SceneLines:
    """Boxes with their names, and the reasons why they or the camera are not fine."""
    parts = [_one_box(view, each) for each in view.boxes]
    if view.warning:
        corner = unprojected(view.camera, np.zeros(2), _usual_depth(view))
        parts.append(label(corner, view.warning, COLOURS[view.verdict], WARNING_RANK))
    return joined(parts)


def standing_lines(view: PictureView) -> SceneLines:
    """The volumes of the players where the feet of their boxes meet the ground."""
    parts = []
    for each in view.boxes:
        foot, volume = _standing(view, each), view.volumes.get(each.name)
        if foot is not None and volume is not None:
            edges = in_front(view.camera, volume_edges(volume, foot))
            parts.append(strokes(edges, faded(COLOURS[each.verdict], 0.6), 1.5))
            parts.append(dots(foot, COLOURS[each.verdict], 7.0))
    return joined(parts)


def mark_lines(view: PictureView) -> SceneLines:
    """Ground points as crosses, each with the way to where the camera sees its ground."""
    return joined(_one_mark(view, each) for each in view.marks)


def standing_at(camera: Camera, box: tuple[float, float, float, float]) -> np.ndarray | None:
    """Where the middle of a box's lower edge meets the ground (3,); None if nobody can see it."""
    place = foot_of(camera, box)
    if place is None or not np.abs(place).max() < FARTHEST:
        return None
    foot = np.array([*place, 0.0])
    return foot if depth_of(camera, foot) >= NEAR else None


def _standing(view: PictureView, each: PictureBox) -> np.ndarray | None:
    return standing_at(view.camera, each.box) if view.is_known else None


def _one_box(view: PictureView, each: PictureBox) -> SceneLines:
    left, top, right, bottom = each.box
    if not np.isfinite(each.box).all():
        return SceneLines()
    foot = _standing(view, each)
    # Without a foot on the ground it hangs where the players of such pictures stand.
    depth = _usual_depth(view) if foot is None else float(depth_of(view.camera, foot))
    pixels = np.array([(left, top), (right, top), (right, bottom), (left, bottom)])
    corners = unprojected(view.camera, pixels, depth)
    sides = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    colour = COLOURS[each.verdict]
    rank = WARNING_RANK if each.warning else NAME_RANK
    words = label(corners[0], each.warning or each.name, colour, rank)
    return strokes(sides, colour, 2.0) + words


def _one_mark(view: PictureView, mark: GroundMark) -> SceneLines:
    spot = np.array([*mark.ground, 0.0])
    seen, depth = project(view.camera, spot[None])
    before = view.is_known and bool(depth[0] >= NEAR)
    reach = float(depth[0]) if before else _usual_depth(view)
    half, pixel = CROSS * view.camera.height, np.array(mark.pixel, np.float64)
    arms = np.array([[(-half, 0), (half, 0)], [(0, -half), (0, half)]]) + pixel
    cross = unprojected(view.camera, arms, reach)
    at = unprojected(view.camera, pixel, reach)
    parts = strokes(cross, NEUTRAL, 2.0)
    if not view.is_known:
        return parts + label(at, mark.name, NEUTRAL, NAME_RANK)
    if not before:
        return parts + label(at, f"{mark.name}: behind the camera", RED, WARNING_RANK)
    miss = math.dist(seen[0], mark.pixel)
    colour = NEUTRAL if miss <= half else AMBER
    way = strokes(np.stack([at, spot])[None], colour, 2.0) + dots(spot, colour, 6.0)
    return parts + way + label(at, f"{mark.name}: {miss:.1f} px", colour, NAME_RANK)


def _usual_depth(view: PictureView) -> float:
    """Metres from the camera to the middle of the known ground."""
    low, high = view.ground or ((0.0, 0.0), (0.0, 0.0))
    middle = np.array([*(np.add(low, high) / 2), 0.0])
    return max(float(depth_of(view.camera, middle)), 1.0)


def _mesh_label(view: PictureView, mesh: float, colour: Colour) -> SceneLines:
    """How wide the meshes are, at the nearest corner that is seen."""
    corners = np.array(list(_corners(*view.ground)))
    pixels, depth = project(view.camera, corners)
    # Comparing with NaN is false: corners behind the camera are never inside.
    size = view.camera.width, view.camera.height
    inside = ((pixels >= 0) & (pixels < size)).all(axis=1)
    if not inside.any():
        return SceneLines()
    nearest = corners[np.where(inside, depth, np.inf).argmin()]
    return label(nearest, f"{mesh:g} m", colour, SCALE_RANK)


def _corners(low: tuple[float, float], high: tuple[float, float]) -> Iterator[tuple]:
    yield from ((x, y, 0.0) for x in (low[0], high[0]) for y in (low[1], high[1]))
