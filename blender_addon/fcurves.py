"""F-curves of an object, across Blender's two ways of keeping them (layers since 4.4, 5.0)."""

from collections.abc import Iterator

import bpy
import numpy as np

from pe_runtime.contract.errors import ShotError

ACTION_PATH = "playable.action"
"""The action of a playable object, as curves name it."""
_INTERPOLATION = {"CONSTANT": 0, "LINEAR": 1}
_HANDLE_TYPES = ("handle_left_type", "handle_right_type")
_KEY_PAIRS = ("co", "handle_left", "handle_right")
_KEY_KINDS = ("interpolation", "easing", "type", *_HANDLE_TYPES)
SAME_FRAME = 1e-3
"""Keys nearer to a frame than this are at it: graph editors leave them a little off."""


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
    channel: tuple[str, int],
    frames: np.ndarray,
    values: np.ndarray,
    replaced: np.ndarray | None = None,
) -> None:
    """Key one curve LINEAR, all at once (single inserts take seconds for a shot).

    Args:
        curves: Where it is, or is made.
        channel: Data path and array index.
        frames: (frames,) whole scene frames without a gap.
        values: (frames,) what to key there.
        replaced: (frames,) whether each is keyed anew; None for all. At the others keys stay to
            the bit, and beyond the first and the last frame as at those.
    """
    if replaced is None:
        replaced = np.ones(len(frames), bool)
    if not replaced.any():
        return
    data_path, index = channel
    curve = curves.find(data_path, index=index) or curves.new(data_path, index=index)
    kept = _read_keys(curve)
    places = np.rint(kept["co"][:, 0]).astype(np.int64) - int(frames[0])
    stays = ~replaced[np.clip(places, 0, len(frames) - 1)]
    kept = {name: numbers[stays] for name, numbers in kept.items()}
    made = _linear_keys(frames[replaced], values[replaced])
    joined = {name: np.concatenate([kept[name], made[name]]) for name in made}
    order = np.argsort(joined["co"][:, 0], kind="stable")
    curve.keyframe_points.clear()
    curve.keyframe_points.add(len(order))
    for name, numbers in joined.items():
        curve.keyframe_points.foreach_set(name, numbers[order].ravel())
    curve.update()


def _linear_keys(frames: np.ndarray, values: np.ndarray) -> dict[str, np.ndarray]:
    points = np.stack([frames, values], axis=1).astype(np.float32)
    vector = bpy.types.Keyframe.bl_rna.properties["handle_left_type"].enum_items["VECTOR"].value
    numbers = {"interpolation": _INTERPOLATION["LINEAR"]} | dict.fromkeys(_HANDLE_TYPES, vector)
    kinds = {n: np.full(len(points), numbers.get(n, 0), np.int32) for n in _KEY_KINDS}
    return dict.fromkeys(_KEY_PAIRS, points) | kinds


def _read_keys(curve: bpy.types.FCurve) -> dict[str, np.ndarray]:
    """All that makes up the keys of a curve, one row each."""
    points, found = curve.keyframe_points, {}
    for name in _KEY_PAIRS:
        found[name] = np.empty((len(points), 2), np.float32)
        flat = found[name].ravel()
        points.foreach_get(name, flat)
    for name in _KEY_KINDS:
        found[name] = np.empty(len(points), np.int32)
        points.foreach_get(name, found[name])
    return found


def remove_curves(target: bpy.types.Object, data_path: str) -> None:
    """Delete every curve of one property, whatever its index."""
    curves = curves_of(target)
    for curve in [each for each in curves or () if each.data_path == data_path]:
        curves.remove(curve)


def every_curve(target: bpy.types.Object, data_path: str) -> Iterator[bpy.types.FCurve]:
    """The F-curves of one property, in a target's action and in its NLA strips."""
    yield from (each for each in curves_of(target) or () if each.data_path == data_path)
    animation = target.animation_data
    tracks = animation.nla_tracks if animation is not None else ()
    for strip in (strip for track in tracks for strip in track.strips):
        yield from (each for each in strip_curves(strip) if each.data_path == data_path)


def strip_curves(strip: bpy.types.NlaStrip) -> Iterator[bpy.types.FCurve]:
    """The F-curves that an NLA strip plays; none of a strip of strips."""
    if strip.action is None or strip.action_slot is None:
        return
    for layer in strip.action.layers:
        for part in layer.strips:
            bag = part.channelbag(strip.action_slot)
            yield from bag.fcurves if bag is not None else ()


def key_points(curve: bpy.types.FCurve) -> np.ndarray:
    """(keys, 2) float32: the frame and the value of every key, in order of frames."""
    points = np.empty(2 * len(curve.keyframe_points), np.float32)
    curve.keyframe_points.foreach_get("co", points)
    return points.reshape(-1, 2)


def is_stepped(curve: bpy.types.FCurve) -> bool:
    """Whether every key of a curve holds until the next one."""
    kinds = np.empty(len(curve.keyframe_points), np.int32)
    curve.keyframe_points.foreach_get("interpolation", kinds)
    return not (kinds != _INTERPOLATION["CONSTANT"]).any()


def make_stepped(target: bpy.types.Object, data_path: str) -> int:
    """Let keys of a property hold until the next one; how many of its curves had others."""
    changed = 0
    for curve in every_curve(target, data_path):
        # Only where needed: every write makes Blender evaluate the scene again.
        if is_stepped(curve) or not curve.id_data.is_editable:
            continue
        kinds = np.full(len(curve.keyframe_points), _INTERPOLATION["CONSTANT"], np.int32)
        curve.keyframe_points.foreach_set("interpolation", kinds)
        curve.update()
        curve.id_data.update_tag()
        changed += 1
    return changed


def held_value(target: bpy.types.Object, data_path: str, frame: float) -> float | None:
    """The value of the last key up to a frame, whatever lies between keys.

    Returns:
        None where the keys do not tell: there are none, all hold already, or something else than
        the keys has a say, such as NLA strips, drivers, modifiers and muted curves.
    """
    animation, curves = target.animation_data, curves_of(target)
    curve = curves.find(data_path) if curves is not None else None
    if curve is None or is_stepped(curve) or curve.mute or len(curve.modifiers):
        return None
    driven = any(driver.data_path == data_path for driver in animation.drivers)
    if driven or (animation.use_nla and len(animation.nla_tracks)):
        return None
    frames, values = key_points(curve).T
    last = int(np.searchsorted(frames, frame + SAME_FRAME, side="right")) - 1
    return float(values[max(last, 0)])
