"""A blocky person of boxes hung on pivots at hips and shoulders.

Local frame of a person: origin on the ground between the feet, Z up, facing -Y; the right-hand
side is -X. Lengths in metres; about 1.8 m tall.
"""

from dataclasses import dataclass

import bpy
import numpy as np

from blender_addon.datagen.appearance import Outfit
from blender_addon.datagen.materials import Palette
from blender_addon.datagen.motion import ARM_OVERHEAD, Gait
from blender_addon.datagen.recordable import ACTION

HIP_HEIGHT = 0.86
HIP_APART = 0.12
SHOULDER_HEIGHT = 1.42
SHOULDER_APART = 0.315
TOE, HEEL = 0.19, 0.09  # reach of a shoe in front of and behind the leg's axis

# part: colour, pivot, centre, size; the centre is relative to the pivot.
_BODY = (
    ("trousers", (0.0, 0.0, 0.93), (0.38, 0.23, 0.18)),
    ("shirt", (0.0, 0.0, 1.24), (0.47, 0.27, 0.46)),
    ("skin", (0.0, 0.0, 1.50), (0.15, 0.15, 0.08)),
    ("skin", (0.0, -0.01, 1.635), (0.23, 0.24, 0.23)),
    ("hair", (0.0, 0.0, 1.765), (0.27, 0.28, 0.07)),
    ("hair", (0.0, 0.105, 1.655), (0.27, 0.07, 0.17)),
)
_LEG = (
    ("trousers", (0.0, 0.0, -0.38), (0.18, 0.20, 0.80)),
    ("shoes", (0.0, -0.05, 0.055 - HIP_HEIGHT), (0.17, TOE + HEEL, 0.11)),
)
_ARM = (
    ("shirt", (0.0, 0.0, -0.13), (0.16, 0.17, 0.36)),
    ("skin", (0.0, 0.0, -0.46), (0.14, 0.14, 0.32)),
)


@dataclass(frozen=True)
class Person:
    """The objects of one person that move; the boxes hang on them."""

    root: bpy.types.Object
    body: bpy.types.Object
    legs: tuple[bpy.types.Object, bpy.types.Object]
    arms: tuple[bpy.types.Object, bpy.types.Object]


def build_person(scene: bpy.types.Scene, name: str, outfit: Outfit, palette: Palette) -> Person:
    """Add one person, standing at the origin; pairs are (left, right)."""
    build = _Builder(scene, name, outfit, palette)
    root = build.pivot("root", None, (0.0, 0.0, 0.0))
    body = build.pivot("body", root, (0.0, 0.0, 0.0))
    build.boxes(body, _BODY)
    limbs: dict[str, list[bpy.types.Object]] = {"leg": [], "arm": []}
    for side, word in ((1, "left"), (-1, "right")):
        leg = build.pivot(f"{word}_leg", body, (side * HIP_APART, 0.0, HIP_HEIGHT))
        arm = build.pivot(f"{word}_arm", body, (side * SHOULDER_APART, 0.0, SHOULDER_HEIGHT))
        build.boxes(leg, _LEG)
        build.boxes(arm, _ARM)
        limbs["leg"].append(leg)
        limbs["arm"].append(arm)
    return Person(root, body, tuple(limbs["leg"]), tuple(limbs["arm"]))


def key_person(person: Person, frame: int, position: np.ndarray, gait: Gait, action: int) -> None:
    """Key place, heading, limbs and the action taken at a frame (frames run from 1)."""
    t = frame - 1
    person.root.location = position.tolist()
    person.root.rotation_euler = (0.0, 0.0, gait.yaw[t])
    person.root[ACTION] = action
    person.body.location = (0.0, 0.0, standing_rise(gait.leg[t]))
    person.body.rotation_euler = (0.0, 0.5 * gait.sway[t], 0.0)
    for side, leg, arm in zip((1, -1), person.legs, person.arms, strict=True):
        lift = gait.lift[t] if side == -1 else 0.0
        leg.rotation_euler = (side * gait.leg[t], 0.0, 0.0)
        arm.rotation_euler = (-side * gait.arm[t] * (1 - lift), lift * ARM_OVERHEAD, 0.0)
        leg.keyframe_insert("rotation_euler", frame=frame)
        arm.keyframe_insert("rotation_euler", frame=frame)
    person.body.keyframe_insert("location", frame=frame)
    person.body.keyframe_insert("rotation_euler", frame=frame)
    for path in ("location", "rotation_euler", f'["{ACTION}"]'):
        person.root.keyframe_insert(path, frame=frame)


def standing_rise(swing: float) -> float:
    """How far the body rises (metres; may be negative) so that the lower foot touches the ground.

    Args:
        swing: Angle of the legs from upright, one forward, the other back (radians).
    """
    lower = HIP_HEIGHT * np.cos(swing) + max(TOE, HEEL) * abs(np.sin(swing))
    return float(lower - HIP_HEIGHT)


class _Builder:
    """Adds the pivots and boxes of one person to a scene."""

    def __init__(self, scene: bpy.types.Scene, name: str, outfit: Outfit, palette: Palette) -> None:
        self.scene, self.name, self.outfit, self.palette = scene, name, outfit, palette

    def pivot(
        self, part: str, parent: bpy.types.Object | None, location: tuple[float, float, float]
    ) -> bpy.types.Object:
        return self._add(f"{self.name}_{part}", None, parent, location)

    def boxes(self, pivot: bpy.types.Object, parts: tuple) -> None:
        for number, (colour, centre, size) in enumerate(parts):
            mesh = _box(f"{pivot.name}_{number}", size)
            mesh.materials.append(self.palette.flat(getattr(self.outfit, colour)))
            self._add(mesh.name, mesh, pivot, centre)

    def _add(
        self,
        name: str,
        data: bpy.types.Mesh | None,
        parent: bpy.types.Object | None,
        location: tuple[float, float, float],
    ) -> bpy.types.Object:
        added = bpy.data.objects.new(name, data)
        added.parent, added.location = parent, location
        self.scene.collection.objects.link(added)
        return added


def _box(name: str, size: tuple[float, float, float]) -> bpy.types.Mesh:
    corners = [
        tuple(s * (bit - 0.5) for s, bit in zip(size, bits, strict=True))
        for bits in np.ndindex(2, 2, 2)
    ]
    # Corner number = 4 x + 2 y + z; counter-clockwise seen from outside.
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    return mesh
