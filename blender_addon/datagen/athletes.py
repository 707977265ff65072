"""Tennis players in Blender: a mesh on an armature below a root Empty, posed frame by frame."""

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Euler

from blender_addon.datagen.athlete_motion import Movement
from blender_addon.datagen.athlete_shape import Shape, body_shape, skeleton
from blender_addon.datagen.kits import Kit
from blender_addon.datagen.materials import Palette
from blender_addon.datagen.recordable import ACTION, PLAYABLE


@dataclass(frozen=True)
class Athlete:
    """The objects of one player that move."""

    root: bpy.types.Object
    armature: bpy.types.Object


def build_athlete(scene: bpy.types.Scene, name: str, kit: Kit, palette: Palette) -> Athlete:
    """Add one player, standing at the origin and facing -Y."""
    root = bpy.data.objects.new(f"{name}_root", None)
    root[PLAYABLE] = name
    scene.collection.objects.link(root)
    armature = _build_armature(scene, name)
    armature.parent = root
    armature.scale = (kit.build, kit.build, kit.stature)
    shape = body_shape(kit.skirt, kit.long_hair)
    body = bpy.data.objects.new(f"{name}_body", _build_mesh(name, shape, kit, palette))
    body.parent = armature
    scene.collection.objects.link(body)
    for bone, numbers, share in shape.weights:
        group = body.vertex_groups.get(bone) or body.vertex_groups.new(name=bone)
        group.add(numbers, share, "REPLACE")
    deform = body.modifiers.new("skeleton", "ARMATURE")
    deform.object = armature
    # Keeps elbows and knees from thinning out when they bend.
    deform.use_deform_preserve_volume = True
    return Athlete(root, armature)


def key_athlete(
    athlete: Athlete, positions: np.ndarray, actions: np.ndarray, movement: Movement
) -> None:
    """Key place, heading, limbs and actions of every frame.

    Args:
        athlete: The player.
        positions: (frames, 3) ground points in metres.
        actions: (frames - 1,) index of the action taken from each frame to the next.
        movement: What the body does.
    """
    stature = athlete.armature.scale.z
    for t, pose in enumerate(movement.poses):
        frame = t + 1
        athlete.root.location = positions[t].tolist()
        athlete.root.rotation_euler = (0.0, 0.0, movement.yaw[t])
        athlete.root[ACTION] = int(actions[min(t, len(actions) - 1)])
        for path in ("location", "rotation_euler", f'["{ACTION}"]'):
            athlete.root.keyframe_insert(path, frame=frame)
        athlete.armature.location.z = stature * movement.rise[t]
        athlete.armature.keyframe_insert("location", frame=frame)
        for bone in athlete.armature.pose.bones:
            rest = bone.bone.matrix_local.to_quaternion()
            turn = Euler(pose[bone.name]).to_quaternion()
            # Angles are in the player's axes; Blender wants them in the bone's own.
            bone.rotation_quaternion = rest.inverted() @ turn @ rest
            bone.keyframe_insert("rotation_quaternion", frame=frame)


def _build_armature(scene: bpy.types.Scene, name: str) -> bpy.types.Object:
    armature = bpy.data.objects.new(f"{name}_skeleton", bpy.data.armatures.new(name))
    scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    # Bones can be added in edit mode only.
    bpy.ops.object.mode_set(mode="EDIT")
    for bone_name, rest in skeleton().items():
        bone = armature.data.edit_bones.new(bone_name)
        bone.head, bone.tail = rest.head, rest.tail
        if rest.parent:
            bone.parent = armature.data.edit_bones[rest.parent]
    bpy.ops.object.mode_set(mode="OBJECT")
    return armature


def _build_mesh(name: str, shape: Shape, kit: Kit, palette: Palette) -> bpy.types.Mesh:
    mesh = bpy.data.meshes.new(f"{name}_body")
    mesh.from_pydata(shape.corners.tolist(), [], shape.faces)
    slots = {part: number for number, part in enumerate(dict.fromkeys(shape.parts))}
    for part in slots:
        mesh.materials.append(palette.flat(getattr(kit, part)))
    mesh.polygons.foreach_set("material_index", [slots[part] for part in shape.parts])
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    return mesh
