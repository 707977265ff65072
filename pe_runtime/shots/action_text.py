"""Actions as text, counted in model steps.

Two forms: `2*5,4*8;1*13` has the players in the model's order and counts actions from 1, as the
keys of `pe play` do; `player_1=left*5,raise_arm*2;player_2=idle*7` says their names. Numbers and
names mix.
"""

import difflib
import math
from collections.abc import Mapping, Sequence

from pe_runtime.contract.errors import ShotError

Runs = dict[str, list[tuple[int, int]]]
"""Per object: action index and the number of steps it is held."""
FORM = "player_1=left*5,raise_arm*2;player_2=idle*7"
SHORT_FORM = "2*5,4*8;1*13"


def parse_actions(text: str, action_names: Mapping[str, tuple[str, ...]]) -> Runs:
    """Read actions from text; `*N` holds an action for N steps, without it for one.

    Args:
        text: Objects separated by `;`, their actions by `,`. Without names they are in the model's
            order, and an object whose part is empty stands still.
        action_names: Per playable object the names of its actions.

    Raises:
        ShotError: The form is wrong, or an object or action is unknown.
    """
    read = _named_parts if "=" in text else _ordered_parts
    runs = {
        name: [parse_run(item, action_names[name]) for item in listed.split(",")]
        for name, listed in read(text, action_names).items()
    }
    if not runs:
        raise ShotError(f"actions: expected {SHORT_FORM!r} or {FORM!r}, found {text!r}")
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


def is_run(item: str, names: Sequence[str]) -> bool:
    """Whether a word means to be an action: a number or a name, held or not."""
    action = item.partition("*")[0].strip()
    return "*" in item or action.isdecimal() or action in names


def parse_run(item: str, names: Sequence[str]) -> tuple[int, int]:
    """Read `left`, `4` or `left*5` as an action's index and the steps for which it is held.

    Args:
        item: Name of an action, or its number counted from 1.
        names: Names of the actions.

    Raises:
        ShotError: There is no such action, or it is held for no step.
    """
    action, star, count = (piece.strip() for piece in item.partition("*"))
    if star and not (count.isdecimal() and int(count) > 0):
        raise ShotError(f"actions: {item!r} must be held for 1 step or more, as in 'left*5'")
    steps = int(count) if star else 1
    if action in names:
        return list(names).index(action), steps
    if action.isdecimal() and 1 <= int(action) <= len(names):
        return int(action) - 1, steps
    numbered = ", ".join(f"{number} {name}" for number, name in enumerate(names, start=1))
    raise ShotError(
        f"actions: no action {action!r}, this model has {numbered or 'none'}{_hint(action, names)}"
    )


def _named_parts(text: str, action_names: Mapping[str, tuple[str, ...]]) -> dict[str, str]:
    parts: dict[str, str] = {}
    for part in filter(None, map(str.strip, text.split(";"))):
        name, equals, listed = (piece.strip() for piece in part.partition("="))
        if not equals or name in parts:
            raise ShotError(f"actions: expected {FORM!r}, each object once; found {part!r}")
        if name not in action_names:
            known = tuple(action_names)
            raise ShotError(
                f"actions: no object {name!r}, this model has {', '.join(known)}"
                f"{_hint(name, known)}"
            )
        parts[name] = listed
    return parts


def _ordered_parts(text: str, action_names: Mapping[str, tuple[str, ...]]) -> dict[str, str]:
    parts = [part.strip() for part in text.split(";")]
    if len(parts) > len(action_names):
        raise ShotError(
            f"actions: {text!r} is for {len(parts)} players, this model has "
            f"{len(action_names)}: {', '.join(action_names)}"
        )
    return {name: part for name, part in zip(action_names, parts, strict=False) if part}


def _hint(name: str, known: Sequence[str]) -> str:
    near = difflib.get_close_matches(name, known, n=1)
    return f"; did you mean {near[0]!r}?" if near else ""
