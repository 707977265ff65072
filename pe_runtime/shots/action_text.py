"""Actions as text: `player_1=left*5,raise_arm*2;player_2=idle*7`, counted in model steps."""

import difflib
import math
from collections.abc import Mapping

from pe_runtime.contract.errors import ShotError

Runs = dict[str, list[tuple[int, int]]]
"""Per object: action index and the number of steps it is held."""
FORM = "player_1=left*5,raise_arm*2;player_2=idle*7"


def parse_actions(text: str, action_names: Mapping[str, tuple[str, ...]]) -> Runs:
    """Read actions from text; `*N` holds an action for N steps, without it for one.

    Args:
        text: Objects separated by `;`, their actions by `,`.
        action_names: Per playable object the names of its actions.

    Raises:
        ShotError: The form is wrong, or an object or action is unknown.
    """
    runs: Runs = {}
    for part in filter(None, map(str.strip, text.split(";"))):
        name, equals, listed = (piece.strip() for piece in part.partition("="))
        if not equals or name in runs:
            raise ShotError(f"actions: expected {FORM!r}, each object once; found {part!r}")
        if name not in action_names:
            raise _unknown("object", name, tuple(action_names))
        runs[name] = [_run(item.strip(), action_names[name]) for item in listed.split(",")]
    if not runs:
        raise ShotError(f"actions: expected {FORM!r}, found {text!r}")
    return runs


def steps_of(runs: Runs) -> int:
    """Steps until the longest of the objects' lists ends; the others hold their last action."""
    return max((sum(count for _, count in run) for run in runs.values()), default=0)


def keys_of(
    runs: list[tuple[int, int]], frame_start: int, frames_per_step: float
) -> tuple[tuple[int, int], ...]:
    """Action keys (frame, action index): each at the frame from which its first step is taken."""
    keys: dict[int, int] = {}
    step = 0
    for action, count in runs:
        keys[frame_start + math.floor(step * frames_per_step + 1e-6)] = action
        step += count
    return tuple(keys.items())


def _run(item: str, names: tuple[str, ...]) -> tuple[int, int]:
    action, star, count = (piece.strip() for piece in item.partition("*"))
    if star and not (count.isdecimal() and int(count) > 0):
        raise ShotError(f"actions: {item!r} must be held for 1 step or more, as in 'left*5'")
    if action not in names:
        raise _unknown("action", action, names)
    return names.index(action), int(count) if star else 1


def _unknown(kind: str, name: str, known: tuple[str, ...]) -> ShotError:
    near = difflib.get_close_matches(name, known, n=1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    return ShotError(f"actions: no {kind} {name!r}, this model has {', '.join(known)}{hint}")
