"""Which objects of an encoded picture can lend their style to which. No `bpy` here."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

from pe_runtime.contract.errors import ShotError


@dataclass(frozen=True)
class Lender:
    """An object of an encoded picture whose style can be had.

    Attributes:
        number: What a key stores for it: its place in the state, from 1 on.
        name: What it is called in the model.
        sizes: How many numbers its style and its pose have; those of one class have as many.
    """

    number: int
    name: str
    sizes: tuple[int, int]


@lru_cache(maxsize=32)
def lenders_of(state: str) -> Mapping[str, Lender]:
    """The objects that a picture shows, by name.

    Args:
        state: A state's JSON, as `stored_state` gives it.

    Raises:
        ShotError: It is no state.
    """
    try:
        found = {}
        for number, (name, each) in enumerate(json.loads(state)["objects"].items(), start=1):
            if each.get("visible", True):
                found[name] = Lender(number, name, (len(each["style"]), len(each["pose"])))
        return found
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ShotError(f"an encoded picture was damaged ({error!r}); encode it again") from error


def lenders_for(state: str, name: str) -> tuple[Lender, ...]:
    """The other objects of a picture that an object can take its style from."""
    known = lenders_of(state)
    own = known.get(name)
    return tuple(each for each in known.values() if own and each != own and each.sizes == own.sizes)


def check_class(taker: str, own: Lender | None, lender: Lender, called: str) -> None:
    """See that two objects are of one class.

    Args:
        taker: Object that takes the style.
        own: The same in its own picture; None where that does not show it.
        lender: Whose style it is to take.
        called: That one, in words.

    Raises:
        ShotError: They are not.
    """
    if own is not None and own.sizes != lender.sizes:
        raise ShotError(
            f"{taker!r} cannot take the style of {called}: it has {own.sizes[0]} numbers for style "
            f"and {own.sizes[1]} for pose, that one {lender.sizes[0]} and {lender.sizes[1]}; "
            "choose an object of the same class"
        )


@lru_cache(maxsize=64)
def lender_items(state: str, name: str) -> tuple[tuple[str, str, str, int], ...]:
    """Enum items for the objects that an object can take its style from; 0 is nobody."""
    # Cached for its references too: Blender does not keep the strings of dynamic items alive.
    chosen = (
        (f"L{each.number}", each.name, "Its style in this environment's picture", each.number)
        for each in lenders_for(state, name)
    )
    return (NOBODY, *chosen)


@lru_cache(maxsize=64)
def source_items(entries: tuple[tuple[int, str], ...]) -> tuple[tuple[str, str, str, int], ...]:
    """Enum items for styles from other pictures, of (number, name); 0 is nobody."""
    chosen = (
        (f"S{number}", name, "A style from another picture", number) for number, name in entries
    )
    return (NOBODY, *chosen)


@lru_cache(maxsize=16)
def player_items(names: tuple[str, ...]) -> tuple[tuple[str, str, str, int], ...]:
    """Enum items for the playable objects of a model; 0 is nobody."""
    chosen = (
        (f"P{number}", name, "The other picture shows it", number)
        for number, name in enumerate(names, start=1)
    )
    return (NOBODY, *chosen)


NOBODY = ("NONE", "None", "Nothing is chosen yet: the style stays its own", 0)
