"""The scene `duel`: a court and two blocky people, built in Blender and keyed frame by frame.

The sequence number and the seed decide everything: the same pair gives the same scene in every
process. World: metres, Z up; frames run from 1.
"""

from dataclasses import replace

import bpy
import numpy as np

from blender_addon.datagen.appearance import Surroundings, draw_outfits, draw_surroundings
from blender_addon.datagen.materials import Palette, forbid_bounces, make_sky
from blender_addon.datagen.motion import (
    ACTIONS,
    FRAMES,
    PLAYERS,
    STEPS_PER_SECOND,
    Motion,
    Plan,
    draw_sequence,
)
from blender_addon.datagen.neighbourhood import explore
from blender_addon.datagen.people import Person, build_person, key_person
from blender_addon.datagen.recordable import PLAYABLE, Recordable
from blender_addon.datagen.staging import add_camera, add_sun, empty_scene
from blender_addon.datagen.surfaces import tiled_mesh

GROUND_X, GROUND_Y = (-14.0, 14.0), (-12.0, 9.0)
WALL_Y, WALL_TOP = 9.0, 3.5

# Service-box-like court: outer edges and the lines inside it, centre lines in metres.
_COURT_X, _COURT_Y = 4.2, (-4.6, 4.6)
_SERVICE_Y = (-2.2, 2.2)
_LINE = 0.10
_PANELS = ((-11.0, -7.0), (-4.5, -1.0), (1.5, 5.0), (7.5, 11.0))
_PANEL_Z = (0.6, 2.7)


def build_duel(seed: int, sequence: int, frames: int = FRAMES) -> Recordable:
    """Empty Blender and build one sequence of `duel` in it."""
    return build_planned(draw_sequence(seed, sequence, frames), "duel")


def build_duel_camera(seed: int, sequence: int, frames: int = FRAMES) -> Recordable:
    """Empty Blender and build one sequence of `duel` whose second camera explores.

    What the first camera sees is the sequence of `duel` with the same numbers.
    """
    plan = draw_sequence(seed, sequence, frames)
    # A source of its own: the colours drawn next must be those of `duel`.
    rng = np.random.default_rng((seed, sequence, 1))
    first, _ = plan.views
    views = first, explore(rng, first, plan.motion.positions)
    return build_planned(replace(plan, views=views), "duel-camera")


def build_planned(plan: Plan, name: str) -> Recordable:
    """Empty Blender and build a planned sequence; what it wears is drawn from the plan's rng."""
    scene = empty_scene(len(plan.motion.positions), STEPS_PER_SECOND)
    colours = draw_surroundings(plan.rng)
    palette = Palette()
    _build_court(scene, palette, colours)
    make_sky(scene, colours.horizon, colours.zenith)
    add_sun(scene, plan.rng)
    outfits = draw_outfits(plan.rng, len(PLAYERS))
    for index, (player, outfit) in enumerate(zip(PLAYERS, outfits, strict=True)):
        person = build_person(scene, player, outfit, palette)
        person.root[PLAYABLE] = player
        _key_motion(person, plan.motion, index)
    for number, path in enumerate(plan.views):
        add_camera(scene, number, path)
    forbid_bounces(scene)
    return Recordable(scene, name, ACTIONS, STEPS_PER_SECOND)


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
    ground = tiled_mesh("ground", GROUND_X, GROUND_Y, groups, colours.outer, palette)
    scene.collection.objects.link(ground)

    groups = [
        ([(*panel, *_PANEL_Z)], colours.panels[k % len(colours.panels)])
        for k, panel in enumerate(_PANELS)
    ]
    wall = tiled_mesh("wall", GROUND_X, (0.0, WALL_TOP), groups, colours.wall, palette)
    # The mesh is drawn flat; standing it up turns its +Z towards the cameras at -Y.
    wall.rotation_euler.x = np.pi / 2
    wall.location.y = WALL_Y
    scene.collection.objects.link(wall)
