"""Where the keys of an Empty put it: its predicted path, and wherever the artist has left that."""

from collections.abc import Sequence

import bpy
import numpy as np

from ..fcurves import curves_of

PARTS = ("co", "handle_left", "handle_right")


def keyed_way(each: bpy.types.Object, root: bpy.types.Object, frames: range) -> np.ndarray | None:
    """Positions (frames, 3) of an Empty by its location keys, environment space.

    Args:
        each: A playable object's Empty.
        root: The environment's.
        frames: Scene frames.

    Returns:
        None where keys do not tell: not all of its location is keyed, or it hangs elsewhere.
    """
    curves = _location_curves(each)
    offset = np.array(each.matrix_parent_inverse)
    if each.parent != root or len(curves) < 3 or not np.allclose(offset, np.eye(4), atol=1e-6):
        return None
    return np.stack([[curve.evaluate(frame) for frame in frames] for curve in curves], axis=1)


def keys_of(each: bpy.types.Object) -> bytes:
    """Something that changes whenever `keyed_way` may; cheap to ask for."""
    parts = []
    for curve in _location_curves(each):
        for part in PARTS:
            numbers = np.empty(2 * len(curve.keyframe_points), np.float32)
            curve.keyframe_points.foreach_get(part, numbers)
            parts.append(numbers.tobytes())
    return b"".join(parts)


def _location_curves(each: bpy.types.Object) -> Sequence[bpy.types.FCurve]:
    curves = curves_of(each)
    found = [curves.find("location", index=axis) for axis in range(3)] if curves else []
    return [curve for curve in found if curve is not None]
