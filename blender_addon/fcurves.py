"""F-curves of an object, across Blender's two ways of keeping them (layers since 4.4, 5.0)."""

import bpy
import numpy as np

from pe_runtime.contract.errors import ShotError

_INTERPOLATION = {"CONSTANT": 0, "LINEAR": 1}


def curves_of(target: bpy.types.Object) -> bpy.types.bpy_prop_collection | None:
    """The F-curves that animate an object, or None where it has no action."""
    animation = target.animation_data
    if animation is None or animation.action is None or animation.action_slot is None:
        return None
    for layer in animation.action.layers:
        for strip in layer.strips:
            bag = strip.channelbag(animation.action_slot)
            if bag is not None:
                return bag.fcurves
    return None


def own_curves(target: bpy.types.Object) -> bpy.types.bpy_prop_collection:
    """The F-curves of an object, made if need be, in an action that no other object plays.

    Raises:
        ShotError: The object is linked from another file and cannot be keyed.
    """
    if not target.is_editable:
        raise ShotError(
            f"{target.name!r} is linked from another file and cannot be keyed; "
            "make a library override of it first"
        )
    animation = target.animation_data or target.animation_data_create()
    if animation.action is None:
        animation.action = bpy.data.actions.new(f"{target.name} Action")
    elif animation.action.users - animation.action.use_fake_user > 1:
        # A duplicated object shares action and slot; writing would move the original too.
        handle = animation.action_slot and animation.action_slot.identifier
        animation.action = animation.action.copy()
        if handle:
            animation.action_slot = animation.action.slots[handle]
    action = animation.action
    if animation.action_slot is None:
        suitable = animation.action_suitable_slots
        animation.action_slot = (
            suitable[0] if suitable else action.slots.new(id_type="OBJECT", name=target.name)
        )
    layer = action.layers[0] if action.layers else action.layers.new("Layer")
    strip = layer.strips[0] if layer.strips else layer.strips.new(type="KEYFRAME")
    return strip.channelbag(animation.action_slot, ensure=True).fcurves


def write_curve(
    curves: bpy.types.bpy_prop_collection,
    data_path: str,
    index: int,
    frames: np.ndarray,
    values: np.ndarray,
) -> None:
    """Replace one curve by LINEAR keys, all at once (single inserts take seconds for a shot)."""
    curve = curves.find(data_path, index=index) or curves.new(data_path, index=index)
    points = curve.keyframe_points
    points.clear()
    points.add(len(frames))
    coordinates = np.stack([frames, values], axis=1).astype(np.float32)
    points.foreach_set("co", coordinates.ravel())
    kinds = np.full(len(frames), _INTERPOLATION["LINEAR"], np.int32)
    points.foreach_set("interpolation", kinds)
    curve.update()


def remove_curves(target: bpy.types.Object, data_path: str) -> None:
    """Delete every curve of one property, whatever its index."""
    curves = curves_of(target)
    for curve in [each for each in curves or () if each.data_path == data_path]:
        curves.remove(curve)


def make_stepped(target: bpy.types.Object, data_path: str) -> None:
    """Let keys of a property hold until the next one."""
    for curve in curves_of(target) or ():
        if curve.data_path == data_path:
            for point in curve.keyframe_points:
                point.interpolation = "CONSTANT"
            curve.update()
