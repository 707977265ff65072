"""The scenes `court` and `static-court`: tennis as television shows it, built in Blender.

The sequence number and the seed decide everything: the same pair gives the same scene in every
process. World: metres, Z up; frames run from 1.
"""

import numpy as np

from blender_addon.datagen.athletes import build_athlete, key_athlete
from blender_addon.datagen.kits import draw_kits, uniform_kit
from blender_addon.datagen.materials import Palette, forbid_bounces, make_sky
from blender_addon.datagen.rally import ACTIONS, FRAMES, STEPS_PER_SECOND, draw_rally
from blender_addon.datagen.recordable import Recordable
from blender_addon.datagen.stadium import build_stadium, draw_stadium, usual_stadium
from blender_addon.datagen.staging import add_camera, add_sun, empty_scene

_STATIC_SUN = 1  # the seed of the one sun of `static-court`
_SKY = (0.82, 0.88, 0.94), (0.45, 0.64, 0.88)


def build_court(seed: int, sequence: int, frames: int = FRAMES, static: bool = False) -> Recordable:
    """Empty Blender and build one sequence of `court`, or of `static-court`, in it."""
    plan = draw_rally(seed, sequence, static, frames)
    scene = empty_scene(frames, STEPS_PER_SECOND)
    palette = Palette()
    build_stadium(scene, usual_stadium() if static else draw_stadium(plan.rng), palette)
    make_sky(scene, *_SKY)
    add_sun(scene, np.random.default_rng(_STATIC_SUN) if static else plan.rng)
    kits = (uniform_kit(),) if static else draw_kits(plan.rng, len(plan.players))
    for k, (name, kit) in enumerate(zip(plan.players, kits, strict=True)):
        athlete = build_athlete(scene, name, kit, palette)
        key_athlete(athlete, plan.positions[:, k], plan.actions[:, k], plan.movements[k])
    for number, path in enumerate(plan.views):
        add_camera(scene, number, path)
    forbid_bounces(scene)
    return Recordable(scene, "static-court" if static else "court", ACTIONS, STEPS_PER_SECOND)
