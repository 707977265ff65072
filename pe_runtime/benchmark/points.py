"""The qualities that are measured: every preset, and every switch on its own."""

from collections.abc import Mapping
from dataclasses import Field, dataclass, fields, replace
from typing import Any

from pe_runtime.config import QUALITIES, Quality

SMALL = 1e-3
"""Trial value of a threshold that no preset uses."""


@dataclass(frozen=True)
class Point:
    """One quality with its name in tables.

    Attributes:
        name: "balanced", "bfloat16", "weight_threshold 0.001".
        kind: "baseline", "preset" or "switch".
        quality: Its switches.
    """

    name: str
    kind: str
    quality: Quality

    @property
    def plain(self) -> bool:
        """Whether frames are drawn as training draws them, without the frame renderer."""
        return self.kind == "baseline"


PLAIN = Point("plain", "baseline", Quality())
"""The model's own modules, called one after the other as in training: only samples outside the
volumes are left out, nothing is folded, nothing kept from frame to frame."""


def all_points(
    presets: Mapping[str, Quality] = QUALITIES, switches: bool = True
) -> tuple[Point, ...]:
    """The baseline, presets, then each field of `Quality` alone at each value that presets give it.

    A new field appears by itself; where no preset uses it yet, at a value of its kind.

    Args:
        presets: By name.
        switches: False for the presets only.
    """
    points = [PLAIN]
    points += [Point(name, "preset", quality) for name, quality in presets.items()]
    for field in fields(Quality) if switches else ():
        used = sorted({getattr(each, field.name) for each in presets.values()} - {field.default})
        for value in used or [_trial(field)]:
            named = field.name if isinstance(value, bool) else f"{field.name} {value:g}"
            quality = replace(Quality(), **{field.name: value})
            points.append(Point(named, "switch", quality))
    return tuple(points)


def _trial(field: Field) -> Any:  # noqa: ANN401 a bool or a float
    if isinstance(field.default, bool):
        return not field.default
    return field.default / 2 if field.default else SMALL
