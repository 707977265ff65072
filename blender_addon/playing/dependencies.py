"""What moves a camera: its parents, the targets of its constraints and drivers, and their keys."""

from collections.abc import Iterable, Iterator

import bpy

from ..fcurves import curves_of, strip_curves

PLACE = (
    "location",
    "rotation_euler",
    "rotation_quaternion",
    "rotation_axis_angle",
    "rotation_mode",
    "scale",
    "delta_location",
    "delta_rotation_euler",
    "delta_rotation_quaternion",
    "delta_scale",
)
LENS = ("type", "lens", "sensor_width", "sensor_height", "sensor_fit", "shift_x", "shift_y")
SIMPLE = ("BOOLEAN", "INT", "FLOAT", "ENUM", "STRING")
FOR_LOOKS = ("show_expanded", "active", "is_active", "select")
"""Settings that move nothing."""
Animated = set[tuple[str, int]]


def influences(roots: Iterable[bpy.types.Object]) -> list[bpy.types.ID]:
    """Objects and camera data that have a say in where some objects are and what they see."""
    found: dict[str, bpy.types.ID] = {}
    waiting = list(roots)
    while waiting:
        each = waiting.pop()
        key = f"{type(each).__name__} {each.name_full}"
        if key not in found:
            found[key] = each
            waiting.extend(_direct(each))
    return [found[key] for key in sorted(found)]


def all_curves(owner: bpy.types.ID) -> Iterator[tuple[tuple, bpy.types.FCurve, bool]]:
    """All curves that animate an owner: where each lies, the curve, and whether it counts as it is.

    Those in NLA strips do not: their frames are the strip's, and strips mix.
    """
    animation = owner.animation_data
    if animation is None:
        return
    stands_alone = not (animation.use_nla and len(animation.nla_tracks))
    for curve in curves_of(owner) or ():
        yield ("own",), curve, stands_alone
    for driver in animation.drivers:
        yield ("driver",), driver, False
    for track in animation.nla_tracks:
        for strip in track.strips:
            place = ("strip", track.name, strip.name)
            for curve in strip_curves(strip):
                yield place, curve, False
            for curve in strip.fcurves:
                yield (*place, "of strip"), curve, False


def still_values(owner: bpy.types.ID, animated: Animated) -> Iterator[tuple]:
    """What decides about an owner without being keyed."""
    if isinstance(owner, bpy.types.Object):
        yield _values(owner, PLACE, animated)
        yield owner.parent and owner.parent.name_full, owner.parent_type, owner.parent_bone
        yield tuple(number for row in owner.matrix_parent_inverse for number in row)
        for constraint in owner.constraints:
            yield tuple(_settings(constraint, f'constraints["{constraint.name}"]', animated))
    elif isinstance(owner, bpy.types.Camera):
        yield _values(owner, LENS, animated)
    yield from mixing_values(owner)


def mixing_values(owner: bpy.types.ID) -> Iterator[tuple]:
    """How the drivers and NLA strips of an owner have a say."""
    animation = owner.animation_data
    if animation is None:
        return
    for driver in animation.drivers:
        variables = ((v.type, *(t.data_path for t in v.targets)) for v in driver.driver.variables)
        own = driver.driver.type, driver.driver.expression, driver.mute
        yield driver.data_path, driver.array_index, *own, *variables
    yield animation.use_nla, animation.action_influence, animation.action_blend_type
    for track in animation.nla_tracks:
        yield track.name, track.mute, track.is_solo
        for strip in track.strips:
            yield tuple(_settings(strip, "", set()))


def _direct(each: bpy.types.ID) -> Iterator[bpy.types.ID]:
    if isinstance(each, bpy.types.Object):
        yield from (each.parent,) if each.parent is not None else ()
        yield from (each.data,) if each.type == "CAMERA" else ()
        for constraint in each.constraints:
            single = getattr(constraint, "target", None)
            several = getattr(constraint, "targets", ())
            yield from (t for t in (single, *(s.target for s in several)) if t is not None)
    if each.animation_data is not None:
        for driver in each.animation_data.drivers:
            for variable in driver.driver.variables:
                yield from (t.id for t in variable.targets if isinstance(t.id, bpy.types.Object))


def _values(owner: bpy.types.bpy_struct, names: Iterable[str], animated: Animated) -> tuple:
    return tuple(_value(owner, name, name, animated) for name in names)


def _value(owner: bpy.types.bpy_struct, name: str, path: str, animated: Animated) -> object:
    value = getattr(owner, name)
    if isinstance(value, (str, int, float, set)):
        return None if (path, 0) in animated else str(value)
    return tuple(None if (path, i) in animated else number for i, number in enumerate(value))


def _settings(owner: bpy.types.bpy_struct, path: str, animated: Animated) -> Iterator:
    """The simple settings of a constraint, and whom it aims at."""
    yield owner.type
    for each in owner.bl_rna.properties:
        name = each.identifier
        if each.type == "POINTER" and name == "target":
            target = getattr(owner, name)
            yield target and target.name_full
        elif each.type in SIMPLE and not each.is_readonly and name not in FOR_LOOKS:
            yield name, _value(owner, name, f"{path}.{name}", animated)
