"""A cheap fingerprint of all that a shot is sampled from, and from which frame on a change counts.

Reading it evaluates nothing: it looks at keys, at what is not keyed, and at what depends on what.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import bpy
import numpy as np

from ..fcurves import ACTION_PATH, key_points
from .dependencies import all_curves, influences, mixing_values, still_values
from .stepping import playables_in

KEY_NUMBERS = (("co", 2), ("handle_left", 2), ("handle_right", 2))
KEY_SINGLES = ("amplitude", "back", "period")
KEY_KINDS = ("interpolation", "easing")
ACTED = (ACTION_PATH, "hide_render")
RENDER = (
    "fps",
    "fps_base",
    "resolution_x",
    "resolution_y",
    "resolution_percentage",
    "pixel_aspect_x",
    "pixel_aspect_y",
)
BEFORE_ALL = -(2**31)


@dataclass(frozen=True, eq=False)
class CurveKeys:
    """The keys of one curve.

    Attributes:
        rows: (keys, numbers) float32, all that counts of a key; the first is its frame.
        shape: What decides about the curve as a whole.
        steps: Whether it holds from key to key.
        is_local: Whether a key counts between its neighbours only.
    """

    rows: np.ndarray
    shape: tuple
    steps: bool
    is_local: bool

    def first_change(self, other: "CurveKeys") -> float | None:
        """The first frame at which two curves may differ; None if they are the same."""
        if self.shape != other.shape:
            return BEFORE_ALL
        shared = min(len(self.rows), len(other.rows))
        differing = np.flatnonzero((self.rows[:shared] != other.rows[:shared]).any(axis=1))
        if not len(differing) and len(self.rows) == len(other.rows):
            return None
        first = int(differing[0]) if len(differing) else shared
        # Before its first two keys a curve goes on as they tell.
        if not self.is_local or first < (1 if self.steps else 2):
            return BEFORE_ALL
        if not self.steps:
            return float(self.rows[first - 1, 0])
        changed = [each.rows[first, 0] for each in (self, other) if first < len(each.rows)]
        return float(min(changed))


@dataclass(frozen=True, eq=False)
class Signature:
    """What a shot is sampled from.

    Attributes:
        start: First frame of the scene's range.
        end: Last frame.
        settings: All that is not keyed.
        curves: The keys, by what they move.
    """

    start: int
    end: int
    settings: tuple
    curves: Mapping[tuple, CurveKeys]

    def first_change(self, later: "Signature") -> int | None:
        """The first frame of the later range that may have changed; None if nothing has."""
        if (self.start, self.settings) != (later.start, later.settings):
            return later.start
        if self.curves.keys() != later.curves.keys():
            return later.start
        found = [self.curves[key].first_change(keys) for key, keys in later.curves.items()]
        frames = [frame for frame in found if frame is not None]
        if self.end != later.end:
            frames.append(min(self.end, later.end) + 1)
        if not frames:
            return None
        return int(max(later.start, np.floor(min(frames))))


def signature_of(scene: bpy.types.Scene) -> Signature:
    """The fingerprint of a scene as it is now."""
    settings, curves = [_scene_values(scene)], {}
    players = playables_in(scene)
    cameras = [scene.camera, *(marker.camera for marker in scene.timeline_markers)]
    root = scene.playable_environment.root
    for owner in influences(each for each in (*cameras, root) if each is not None):
        animated = _note_curves(curves, owner, lambda _path: True)
        settings.append((_name(owner), *still_values(owner, animated)))
    for each in players:
        animated = _note_curves(curves, each, lambda path: path in ACTED)
        settings.append((_name(each), *_player_values(each, animated)))
    return Signature(scene.frame_start, scene.frame_end, tuple(settings), curves)


def _scene_values(scene: bpy.types.Scene) -> tuple:
    own = scene.playable_environment
    text = own.state_text.as_string() if own.state_text is not None else ""
    markers = ((m.frame, _name(m.camera)) for m in scene.timeline_markers if m.camera is not None)
    return (
        *(getattr(scene.render, name) for name in RENDER),
        _name(scene.camera),
        tuple(sorted(markers)),
        _name(own.root),
        own.model,
        hash(text),
    )


def _player_values(each: bpy.types.Object, animated: set) -> Iterator:
    playable = each.playable
    yield playable.object_name, playable.action_names
    yield None if (ACTION_PATH, 0) in animated else playable.action
    yield None if ("hide_render", 0) in animated else each.hide_render
    # Where it is parented decides about the keys of its path, though not about the path.
    yield _name(each.parent), each.rotation_mode, each.hide_viewport
    yield from mixing_values(each)


def _note_curves(curves: dict, owner: bpy.types.ID, wanted: object) -> set[tuple[str, int]]:
    """Put the curves of an owner into a table; what of it they animate."""
    animated = set()
    for place, curve, is_own in all_curves(owner):
        if not wanted(curve.data_path):
            continue
        curves[(_name(owner), place, curve.data_path, curve.array_index)] = _keys(curve, is_own)
        animated.add((curve.data_path, curve.array_index))
    return animated


def _keys(curve: bpy.types.FCurve, is_own: bool) -> CurveKeys:
    shape = (curve.extrapolation, curve.mute, *(_modifier(each) for each in curve.modifiers))
    is_local = is_own and not len(curve.modifiers)
    if curve.data_path == ACTION_PATH:
        # It holds whatever its handles are, and Blender moves those with every neighbour.
        return CurveKeys(key_points(curve), shape, True, is_local)
    points, columns = curve.keyframe_points, []
    for name, width in (*KEY_NUMBERS, *((name, 1) for name in KEY_SINGLES)):
        numbers = np.empty(width * len(points), np.float32)
        points.foreach_get(name, numbers)
        columns.append(numbers.reshape(-1, width))
    for name in KEY_KINDS:
        kinds = np.empty(len(points), np.int32)
        points.foreach_get(name, kinds)
        columns.append(kinds[:, None].astype(np.float32))
    return CurveKeys(np.concatenate(columns, axis=1), shape, False, is_local)


def _modifier(modifier: bpy.types.FModifier) -> tuple:
    names = (p.identifier for p in modifier.bl_rna.properties if p.type in ("FLOAT", "INT", "ENUM"))
    return tuple(repr(getattr(modifier, name)) for name in names)


def _name(owner: bpy.types.ID | None) -> str:
    return "" if owner is None else f"{type(owner).__name__} {owner.name_full}"
