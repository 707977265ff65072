"""The overrides of a playable object at the frame that its scene is evaluated at."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import PurePath

import bpy

from pe_runtime.contract.errors import ShotError

from ..state_files import state_file, stored_state
from .key_history import PLACE_PATH, first_change, held_since
from .lenders import Lender, check_class, lenders_of


@dataclass(frozen=True)
class LentStyle:
    """A share of somebody else's look.

    Attributes:
        file: State file of the picture that shows the lender; None for the environment's own.
        object: The lender's name in it.
        weight: Share of the lender, above 0 and up to 1.
    """

    file: str | None
    object: str
    weight: float


@dataclass(frozen=True)
class Override:
    """What an object has differently at one frame.

    Attributes:
        free: Whether its own keys place it, so that baking must not replace them.
        style: The look that it takes on; None for its own.
        held_since: First frame of the holding of its pose; None where the pose is free.
    """

    free: bool = False
    style: LentStyle | None = None
    held_since: int | None = None


def read_override(evaluated: bpy.types.Object, scene: bpy.types.Scene, frame: int) -> Override:
    """The overrides of an evaluated object.

    Args:
        evaluated: From a dependency graph at this frame.
        scene: The original scene.
        frame: The frame.

    Raises:
        ShotError: A style is gone or of another class, or nobody can tell since when a pose is
            held.
    """
    own = evaluated.playable.overrides
    scene = scene.playable_environment.stand_in_for or scene
    held = held_since(evaluated.original, frame) if own.pose == "HELD" else None
    free = own.place == "FREE" and frame >= first_change(evaluated.original, PLACE_PATH)
    return Override(free, _style(evaluated, scene), held)


def _style(evaluated: bpy.types.Object, scene: bpy.types.Scene) -> LentStyle | None:
    own = evaluated.playable.overrides
    weight = min(max(float(own.style_mix), 0.0), 1.0)
    if own.style == "OWN" or weight == 0.0:
        return None
    if own.style == "OBJECT":
        return _from_object(evaluated.playable.object_name, own.lender_number, scene, weight)
    return _from_picture(evaluated.playable.object_name, own.source_number, scene, weight)


def _from_object(
    taker: str, number: int, scene: bpy.types.Scene, weight: float
) -> LentStyle | None:
    if number == 0:
        return None
    known = _own_lenders(scene)
    lender = next((each for each in known.values() if each.number == number), None)
    if lender is None:
        raise ShotError(
            f"{taker!r} takes its style from an object that the environment's picture does not "
            "show; choose another one"
        )
    check_class(taker, known.get(taker), lender, repr(lender.name))
    return None if lender.name == taker else LentStyle(None, lender.name, weight)


def _from_picture(
    taker: str, number: int, scene: bpy.types.Scene, weight: float
) -> LentStyle | None:
    if number == 0:
        return None
    source = scene.playable_environment.styles.by_number(number)
    if source is None:
        raise ShotError(
            f"{taker!r} takes its style from a picture that was removed from Styles; choose "
            "another one, or delete the keys of its Picture"
        )
    model = scene.playable_environment.model
    if PurePath(source.model).name != PurePath(model).name:
        raise ShotError(
            f"the style {source.name!r} was encoded by the model {source.model!r}, the "
            f"environment by {model!r}; remove the style and add it again"
        )
    own = _own_lenders(scene).get(taker)
    check_class(taker, own, source.lender(), repr(source.name))
    return LentStyle(str(state_file(source.state())), source.object_name, weight)


def _own_lenders(scene: bpy.types.Scene) -> Mapping[str, Lender]:
    block = scene.playable_environment.state_text
    if block is None:
        raise ShotError("this scene has no environment; make one with New Playable Environment")
    return lenders_of(stored_state(block.as_string(), block.name))
