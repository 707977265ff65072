"""The environment state: what the encoder finds, the dynamics moves and the renderer draws.

Every manipulation returns a new state; nothing is changed in place, so undo, scrubbing and
branching are free.
"""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from pe_runtime.contract.errors import ConfigError

FORMAT = 1
"""Version of a stored state."""


@dataclass(frozen=True)
class ObjectState:
    """One object at one time: s = (x, w, pi) of the paper.

    Attributes:
        position: Object origin in environment space, metres; float32.
        style: Appearance code w.
        pose: Deformation code pi; empty for static objects.
        visible: Whether the renderer draws it.
        heading: Turn about the world's z axis, radians; 0 where its axes are the world's.
    """

    position: Float[Tensor, "3"]
    style: Float[Tensor, " style"]
    pose: Float[Tensor, " pose"]
    visible: bool = True
    heading: float = 0.0


@dataclass(frozen=True)
class EnvironmentState:
    """All objects, static ones too, by name."""

    objects: Mapping[str, ObjectState]

    def __getitem__(self, name: str) -> ObjectState:
        """The named object.

        Raises:
            ConfigError: There is no such object.
        """
        if name not in self.objects:
            known = ", ".join(self.objects)
            raise ConfigError(f"no object {name!r} in this state; it has: {known}")
        return self.objects[name]


def change(state: EnvironmentState, name: str, **changes: Any) -> EnvironmentState:  # noqa: ANN401
    """The state with some attributes of one object replaced."""
    changed = dataclasses.replace(state[name], **changes)
    return EnvironmentState({**state.objects, name: changed})


def move(state: EnvironmentState, name: str, position: Float[Tensor, "3"]) -> EnvironmentState:
    """Put an object at a position (metres, environment space)."""
    return change(state, name, position=position)


def turn(state: EnvironmentState, name: str, heading: float) -> EnvironmentState:
    """Turn an object about the vertical to a heading (radians)."""
    return change(state, name, heading=heading)


def restyle(state: EnvironmentState, name: str, style: Float[Tensor, " style"]) -> EnvironmentState:
    """Give an object another appearance code; it must have the same length."""
    _same_length(state[name].style, style, f"style of {name!r}")
    return change(state, name, style=style)


def repose(state: EnvironmentState, name: str, pose: Float[Tensor, " pose"]) -> EnvironmentState:
    """Give an object another deformation code; it must have the same length."""
    _same_length(state[name].pose, pose, f"pose of {name!r}")
    return change(state, name, pose=pose)


def hide(state: EnvironmentState, name: str) -> EnvironmentState:
    """Leave an object out of every picture."""
    return change(state, name, visible=False)


def show(state: EnvironmentState, name: str) -> EnvironmentState:
    """Draw an object again."""
    return change(state, name, visible=True)


def blend(a: EnvironmentState, b: EnvironmentState, weight: float) -> EnvironmentState:
    """The state between two: positions, styles and poses at (1 - weight) a + weight b.

    Headings take the shorter way round.

    Args:
        a: State at weight 0; its visibility is kept.
        b: State at weight 1, with the same objects.
        weight: In [0, 1]; 0 and 1 return the very numbers of `a` and `b`.
    """
    if weight == 0.0:
        return a
    objects = {}
    for name, first in a.objects.items():
        second = b[name]
        objects[name] = dataclasses.replace(
            first,
            position=_mix(first.position, second.position, weight),
            style=_mix(first.style, second.style, weight),
            pose=_mix(first.pose, second.pose, weight),
            heading=_between(first.heading, second.heading, weight),
        )
    return EnvironmentState(objects)


def state_as_dict(state: EnvironmentState) -> dict[str, Any]:
    """JSON-able form of a state; float32 values survive the round trip exactly."""
    return {
        "format": FORMAT,
        "objects": {
            name: {
                "position": each.position.tolist(),
                "style": each.style.tolist(),
                "pose": each.pose.tolist(),
                "visible": each.visible,
                "heading": each.heading,
            }
            for name, each in state.objects.items()
        },
    }


def state_from_dict(values: Any) -> EnvironmentState:  # noqa: ANN401
    """Read what `state_as_dict` wrote.

    Raises:
        ConfigError: A key is missing, or a value is not a list of finite numbers.
    """
    found = values.get("format") if isinstance(values, Mapping) else None
    if found != FORMAT:
        raise ConfigError(
            f"this is no environment state of format {FORMAT} (found {found!r}); encode it again"
        )
    try:
        objects = {name: _object_from(each, name) for name, each in values["objects"].items()}
    except (KeyError, TypeError, AttributeError) as problem:
        raise ConfigError(f"this is no environment state: {problem!r} is missing") from problem
    return EnvironmentState(objects)


def _object_from(values: Any, name: str) -> ObjectState:  # noqa: ANN401
    codes = {}
    for key in ("position", "style", "pose"):
        try:
            codes[key] = torch.tensor(values[key], dtype=torch.float32)
        except (TypeError, ValueError) as problem:
            raise ConfigError(f"{key} of {name!r} is not a list of numbers: {problem}") from problem
        if codes[key].ndim != 1 or not torch.isfinite(codes[key]).all():
            raise ConfigError(f"{key} of {name!r} must be a flat list of finite numbers")
    if codes["position"].numel() != 3:
        raise ConfigError(f"position of {name!r} must have 3 numbers")
    visible = values.get("visible", True)
    if not isinstance(visible, bool):
        raise ConfigError(f"visible of {name!r} must be true or false, found {visible!r}")
    heading = values.get("heading", 0.0)
    if isinstance(heading, bool) or not isinstance(heading, int | float):
        raise ConfigError(f"heading of {name!r} must be a number of radians, found {heading!r}")
    if not math.isfinite(heading):
        raise ConfigError(f"heading of {name!r} must be finite, found {heading!r}")
    return ObjectState(**codes, visible=visible, heading=float(heading))


def _same_length(old: Tensor, new: Tensor, what: str) -> None:
    if old.shape != new.shape:
        raise ConfigError(f"{what} has {old.numel()} numbers; {new.numel()} were given")


def _between(first: float, second: float, weight: float) -> float:
    return second if weight == 1.0 else first + weight * math.remainder(second - first, math.tau)


def _mix(first: Tensor, second: Tensor, weight: float) -> Tensor:
    return second if weight == 1.0 else first + weight * (second - first)
