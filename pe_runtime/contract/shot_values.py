"""Typed readers for the values of a shot's JSON; each refuses with the key that is wrong."""

import difflib
import math
from collections.abc import Sequence
from typing import Any, NoReturn

from .errors import ShotError


def read_keys(
    content: object, where: str, required: Sequence[str], optional: Sequence[str]
) -> dict[str, Any]:
    """The content as a dict with every required key and none outside the two lists."""
    if not isinstance(content, dict):
        refuse(where, "a JSON object", content)
    known = (*required, *optional)
    for key in content:
        if key not in known:
            refuse(where, f"only the keys {', '.join(known)}", key, known)
    for key in required:
        if key not in content:
            refuse(where, f"the key {key!r}", sorted(content))
    return content


def read_list(value: object, where: str) -> list:
    """A JSON list."""
    return value if isinstance(value, list) else refuse(where, "a list", value)


def read_text(value: object, where: str) -> str:
    """A JSON string."""
    return value if isinstance(value, str) else refuse(where, "text", value)


def read_optional_text(value: object, where: str) -> str | None:
    """A JSON string or null."""
    return None if value is None else read_text(value, where)


def read_integer(value: object, where: str) -> int:
    """A JSON number without a fraction; true and false are none."""
    return value if type(value) is int else refuse(where, "a whole number", value)


def read_number(value: object, where: str) -> float:
    """A finite JSON number; true and false are none."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        refuse(where, "a finite number", value)
    return float(value)


def read_row(value: object, where: str, count: int) -> tuple[float, ...]:
    """A JSON list of exactly ``count`` finite numbers."""
    if len(read_list(value, where)) != count:
        refuse(where, f"{count} numbers", value)
    return tuple(read_number(entry, where) for entry in value)


def refuse(where: str, expected: str, found: object, known: Sequence[str] = ()) -> NoReturn:
    """Raise the ShotError of one wrong value, naming the nearest of the known words."""
    near = difflib.get_close_matches(found, known, n=1) if isinstance(found, str) else []
    hint = f"; did you mean {near[0]!r}?" if near else ""
    raise ShotError(f"{where}: expected {expected}, found {found!r:.200}{hint}")
