"""Which way an action leads, as seen by the camera. No `bpy` here."""

import json
import math
from collections.abc import Sequence
from functools import lru_cache

RIGHT, LEFT, AHEAD, BACK, STAY = "TRIA_RIGHT", "TRIA_LEFT", "TRIA_UP", "TRIA_DOWN", "DOT"
UNKNOWN = "NONE"
"""Blender's names of the icons."""
STILL_SHARE = 0.15
"""An action that covers less than this share of the longest movement stays where it is."""
STILL_METRES = 0.01


@lru_cache(maxsize=64)
def direction_icons(movements_json: str, actions: int) -> tuple[str, ...]:
    """An icon for each action.

    Args:
        movements_json: A JSON list of [right, ahead], metres per step in the camera's frame, one
            for each action; empty where nobody knows.
        actions: How many actions there are.
    """
    movements = json.loads(movements_json) if movements_json else []
    if len(movements) != actions:
        return (UNKNOWN,) * actions
    longest = max((math.hypot(*each) for each in movements), default=0.0)
    still = max(STILL_METRES, STILL_SHARE * longest)
    return tuple(_icon(each, still) for each in movements)


def _icon(movement: Sequence[float], still: float) -> str:
    right, ahead = movement
    if math.hypot(right, ahead) < still:
        return STAY
    if abs(right) >= abs(ahead):
        return RIGHT if right > 0 else LEFT
    return AHEAD if ahead > 0 else BACK
