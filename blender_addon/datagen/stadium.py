"""The tennis court of `court` and what stands around it.

Everything lies on the ground (z = 0), on the board wall (y = `WALL_Y`) or on the stands that rise
behind it, but for the net along x at y = 0. The spectators are the same in every sequence; only
the colours of court, boards and seats change. World: metres, Z up.
"""

from dataclasses import dataclass

import bpy
import numpy as np

from blender_addon.datagen.appearance import HAIRS, SKINS, Colour, jitter
from blender_addon.datagen.materials import Palette
from blender_addon.datagen.surfaces import add_quads, tiled_mesh

GROUND_X, GROUND_Y = (-16.0, 16.0), (-12.0, 7.5)
WALL_Y, WALL_TOP = 7.5, 0.75
ROWS, ROW_DEPTH, ROW_RISE = 7, 0.55, 0.42
NET_HEIGHT, NET_HALF = 0.85, 4.35

# Half of a court for children, in metres: singles lines, doubles lines, baseline, service line.
SINGLES_X, DOUBLES_X, BASE_Y, SERVICE_Y = 2.95, 3.75, 5.0, 2.7
_LINE = 0.07
_WHITE = (0.94, 0.94, 0.92)
_SEAT = 0.52  # metres from one spectator to the next
_STANDS_X = 13.0
_TAKEN = 0.8  # share of the seats
_CROWD_SEED = 2022
_CROWD = (
    (0.82, 0.80, 0.76), (0.72, 0.30, 0.26), (0.26, 0.38, 0.60), (0.86, 0.74, 0.40),
    (0.34, 0.50, 0.38), (0.30, 0.30, 0.34), (0.66, 0.56, 0.66), (0.84, 0.56, 0.44),
)  # fmt: skip

# inner court, outer court
_COURTS = (
    ((0.22, 0.40, 0.68), (0.26, 0.52, 0.42)),
    ((0.76, 0.43, 0.28), (0.66, 0.36, 0.24)),
    ((0.36, 0.60, 0.32), (0.27, 0.48, 0.27)),
    ((0.42, 0.34, 0.60), (0.30, 0.50, 0.46)),
    ((0.24, 0.46, 0.72), (0.40, 0.62, 0.80)),
    ((0.32, 0.52, 0.44), (0.68, 0.38, 0.32)),
)
# board wall, its boards, steps and seats of the stands
_STANDS = (
    ((0.13, 0.20, 0.36), (0.90, 0.90, 0.88), (0.34, 0.36, 0.42), (0.22, 0.34, 0.58)),
    ((0.12, 0.28, 0.22), (0.88, 0.82, 0.52), (0.40, 0.40, 0.38), (0.20, 0.42, 0.32)),
    ((0.34, 0.16, 0.18), (0.92, 0.90, 0.86), (0.38, 0.35, 0.34), (0.58, 0.24, 0.24)),
    ((0.20, 0.20, 0.24), (0.86, 0.60, 0.26), (0.42, 0.42, 0.46), (0.46, 0.48, 0.52)),
)


@dataclass(frozen=True)
class Stadium:
    """Colours of everything that stands still, sRGB in [0, 1]."""

    inner: Colour
    outer: Colour
    wall: Colour
    board: Colour
    steps: Colour
    seats: Colour


def draw_stadium(rng: np.random.Generator) -> Stadium:
    """Choose court and stands, each colour slightly jittered."""
    court = _COURTS[rng.integers(len(_COURTS))]
    stands = _STANDS[rng.integers(len(_STANDS))]
    return Stadium(*(jitter(rng, colour) for colour in (*court, *stands)))


def usual_stadium() -> Stadium:
    """The one stadium of `static-court`."""
    return Stadium(*_COURTS[0], *_STANDS[0])


def build_stadium(scene: bpy.types.Scene, colours: Stadium, palette: Palette) -> None:
    """Add ground, net, wall and stands."""
    _build_ground(scene, colours, palette)
    _build_net(scene, palette)
    _build_wall(scene, colours, palette)
    _build_stands(scene, colours, palette)
    _build_umpire(scene, palette)


def _build_ground(scene: bpy.types.Scene, colours: Stadium, palette: Palette) -> None:
    half = _LINE / 2
    upright = [(x, -BASE_Y, BASE_Y) for x in (-DOUBLES_X, -SINGLES_X, SINGLES_X, DOUBLES_X)]
    upright += [(0.0, -SERVICE_Y, SERVICE_Y), (0.0, -BASE_Y, -BASE_Y + 0.2)]
    upright += [(0.0, BASE_Y - 0.2, BASE_Y)]
    across = [(y, DOUBLES_X) for y in (-BASE_Y, BASE_Y)]
    across += [(y, SINGLES_X) for y in (-SERVICE_Y, SERVICE_Y)]
    lines = [(x - half, x + half, low - half, high + half) for x, low, high in upright]
    lines += [(-reach - half, reach + half, y - half, y + half) for y, reach in across]
    floor = [(-DOUBLES_X, DOUBLES_X, -BASE_Y, BASE_Y)]
    groups = [(lines, _WHITE), (floor, colours.inner)]
    ground = tiled_mesh("ground", GROUND_X, GROUND_Y, groups, colours.outer, palette)
    scene.collection.objects.link(ground)


def _build_net(scene: bpy.types.Scene, palette: Palette) -> None:
    """A see-through net: id and depth of what stands behind it, its colour laid over."""
    band = _upright(-NET_HALF, NET_HALF, 0.0, (NET_HEIGHT - 0.07, NET_HEIGHT))
    strap = _upright(-0.035, 0.035, -0.01, (0.0, NET_HEIGHT))
    add_quads(scene, "net band", [(band, _WHITE), (strap, _WHITE)], palette.flat)
    mesh = _upright(-NET_HALF, NET_HALF, 0.0, (0.02, NET_HEIGHT - 0.07))
    add_quads(scene, "net", [(mesh, (0.10, 0.11, 0.12))], palette.veil)
    posts = [
        _upright(x - 0.05, x + 0.05, 0.0, (0.0, NET_HEIGHT + 0.05)) for x in (-NET_HALF, NET_HALF)
    ]
    add_quads(scene, "net posts", [(post, (0.20, 0.24, 0.22)) for post in posts], palette.flat)


def _build_wall(scene: bpy.types.Scene, colours: Stadium, palette: Palette) -> None:
    quads = [(_upright(*GROUND_X, WALL_Y, (0.0, WALL_TOP)), colours.wall)]
    rng = np.random.default_rng(_CROWD_SEED)
    for left in np.arange(-12.0, 12.0, 3.0):
        # Sponsors: a few letters' worth of bars, too small to be read.
        x = left + 0.6
        while x < left + 2.2:
            wide = rng.uniform(0.12, 0.32)
            bar = _upright(x, x + wide, WALL_Y - 0.01, (0.22, 0.54))
            quads.append((bar, colours.board))
            x += wide + 0.09
    add_quads(scene, "wall", quads, palette.flat)


def _build_stands(scene: bpy.types.Scene, colours: Stadium, palette: Palette) -> None:
    rng = np.random.default_rng(_CROWD_SEED)
    quads = []
    for row in range(ROWS):
        y, z = WALL_Y + 0.15 + row * ROW_DEPTH, WALL_TOP + row * ROW_RISE
        tread = [(-_STANDS_X, y - 0.2, z), (_STANDS_X, y - 0.2, z)]
        tread += [(_STANDS_X, y + ROW_DEPTH, z), (-_STANDS_X, y + ROW_DEPTH, z)]
        quads.append((tread, colours.steps))
        back = y + ROW_DEPTH - 0.05
        quads.append((_upright(-_STANDS_X, _STANDS_X, back, (z, z + ROW_RISE)), colours.seats))
        for seat in np.arange(-_STANDS_X + 0.3 * (row % 2), _STANDS_X, _SEAT):
            if rng.random() < _TAKEN and abs(abs(seat) - 4.2) > 0.5:  # two stairways stay free
                quads += _spectator(rng, seat, back - 0.12, z + rng.uniform(-0.04, 0.04))
    add_quads(scene, "stands", quads, palette.flat)


def _spectator(rng: np.random.Generator, x: float, y: float, z: float) -> list:
    shirt = _CROWD[rng.integers(len(_CROWD))]
    skin, hair = SKINS[rng.integers(len(SKINS))], HAIRS[rng.integers(len(HAIRS))]
    x += rng.uniform(-0.05, 0.05)
    return [
        (_upright(x - 0.19, x + 0.19, y, (z, z + 0.42)), shirt),
        (_upright(x - 0.09, x + 0.09, y - 0.01, (z + 0.42, z + 0.60)), skin),
        (_upright(x - 0.10, x + 0.10, y - 0.02, (z + 0.57, z + 0.67)), hair),
    ]


def _build_umpire(scene: bpy.types.Scene, palette: Palette) -> None:
    """The umpire's chair beside the net."""
    x, frame, shirt = -NET_HALF - 0.75, (0.22, 0.34, 0.28), (0.20, 0.26, 0.44)
    parts = [(side, side + 0.06, 0.0, (0.0, 1.30)) for side in (x - 0.3, x + 0.24)]
    parts += [(x - 0.3, x + 0.3, 0.0, (step, step + 0.06)) for step in (0.4, 0.8, 1.24)]
    parts += [(x - 0.28, x + 0.28, 0.12, (1.30, 1.85))]
    quads = [(_upright(*part), frame) for part in parts]
    quads += [
        (_upright(x - 0.19, x + 0.19, 0.05, (1.30, 1.78)), shirt),
        (_upright(x - 0.09, x + 0.09, 0.04, (1.78, 1.96)), SKINS[0]),
        (_upright(x - 0.11, x + 0.11, 0.03, (1.92, 2.02)), (0.95, 0.95, 0.94)),
    ]
    add_quads(scene, "umpire", quads, palette.flat)


def _upright(left: float, right: float, y: float, levels: tuple[float, float]) -> list:
    """Corners of a rectangle that stands on the ground's plane and faces -Y."""
    low, high = levels
    return [(left, y, low), (right, y, low), (right, y, high), (left, y, high)]
