"""Reading the release's pickles without unpickling them.

A pickle is a program for a stack machine that may call anything. This one is our own: it knows the
instructions that plain data needs, asks `dataset_values` for the few constructors of data, and
refuses all else before it happens. Nothing that a file names is ever imported, called or changed.
"""

import io
import pickletools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pe_runtime.contract.errors import EpisodeError
from pe_runtime.interop.dataset_values import (
    CONSTRUCTORS,
    STORAGES,
    Constructor,
    Draft,
    RefusedError,
    array_of_storage,
)

LARGEST_FILE = 64 << 20
"""Bytes; the annotations of one sequence take a few megabytes at most."""
MOST_INSTRUCTIONS = 5_000_000
DEEPEST_STACK = 100_000
"""Values begun and not yet put into a container: lists within lists, in a malicious file."""

Globals = Mapping[tuple[str, str], Constructor]
_SCALARS = (str, bytes, int, float, bool, type(None), np.generic)
_DAMAGE = (ValueError, IndexError, KeyError, TypeError, OverflowError)


def read_pickle(path: str | Path) -> Any:  # noqa: ANN401 whatever data the file holds
    """The data in one of the release's pickles: containers, numbers, texts, arrays and `Pose`.

    Raises:
        EpisodeError: The file is missing, too large, damaged, or asks for anything but data; then
            nothing of it has been run.
    """
    path = Path(path)
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise EpisodeError(
                f"{path} has {path.stat().st_size} bytes; annotations of one sequence have at "
                f"most {LARGEST_FILE}: this is no file of the release"
            )
        content = path.read_bytes()
    except OSError as error:
        raise EpisodeError(f"{path} cannot be read: {error.strerror or error}") from error
    try:
        return unpickle(content)
    except RefusedError as refusal:
        raise EpisodeError(f"{path} {refusal}; nothing of it was run, do not trust it") from refusal
    except _DAMAGE as error:
        raise EpisodeError(
            f"{path} is damaged or no pickle ({error}); copy it from the original again"
        ) from error


def unpickle(content: bytes) -> Any:  # noqa: ANN401 whatever data the file holds
    """The data in a pickle.

    Raises:
        RefusedError: It asks for anything but data.
        ValueError, IndexError, KeyError, TypeError, OverflowError: It is damaged.
    """
    constructors = dict(CONSTRUCTORS)
    constructors["torch.storage", "_load_from_bytes"] = Constructor("a tensor's numbers", _storage)
    return _Machine(constructors).run(io.BytesIO(content))


def _storage(content: bytes) -> np.ndarray:
    """The numbers of a tensor, which torch pickles as a file within the file.

    That holds five pickles (magic number, version, machine, the storage's description, its key),
    the count as 8 bytes, and the numbers. The description is a "persistent id".
    """
    stream = io.BytesIO(content)
    parts = [_Machine(STORAGES, persistent=True).run(stream) for _ in range(5)]
    count = int.from_bytes(stream.read(8), "little")
    return array_of_storage(parts[3], count, stream.read())


@dataclass
class _Machine:
    """One run: the values under construction and those to be referred to again.

    Attributes:
        constructors: What GLOBAL may name.
        persistent: Whether a persistent id is data (it stands for itself).
        stack: Values since the last mark.
        marked: The stacks below, one for each open mark.
        memo: Values by number.
    """

    constructors: Globals
    persistent: bool = False
    stack: list[Any] = field(default_factory=list)
    marked: list[list[Any]] = field(default_factory=list)
    memo: dict[int, Any] = field(default_factory=dict)

    def run(self, stream: io.BytesIO) -> Any:  # noqa: ANN401 whatever data the file holds
        """Carry out instructions up to and including STOP."""
        for name, argument in _instructions(stream):
            if name in _LITERALS:
                self.stack.append(_CONSTANTS.get(name, argument))
            elif name in _STEPS:
                _STEPS[name](self, argument)
            elif name not in _IDLE:
                raise RefusedError(f"uses the pickle instruction {name}, which no data needs")
            if len(self.stack) + len(self.marked) > DEEPEST_STACK:
                raise ValueError(f"more than {DEEPEST_STACK} values nested in one another")
        (result,) = self.stack
        if isinstance(result, Draft | Constructor):
            raise ValueError("it ends with something half-made")
        return result

    def since_mark(self) -> list[Any]:
        """Take the values since the last mark off the stack."""
        values, self.stack = self.stack, self.marked.pop()
        return values

    def mark(self, _: object) -> None:
        """MARK."""
        self.marked.append(self.stack)
        self.stack = []

    def remember(self, number: int | None) -> None:
        """MEMOIZE (without a number) and PUT."""
        number = len(self.memo) if number is None else number
        self.memo[number] = self.stack[-1]
        if isinstance(self.stack[-1], Draft):
            self.stack[-1].places.append(number)

    def recall(self, number: int) -> None:
        """GET."""
        self.stack.append(self.memo[number])

    def name_global(self, names: str) -> None:
        """GLOBAL."""
        self.look_up(*names.split(" ", 1))

    def name_stacked_global(self, _: object) -> None:
        """STACK_GLOBAL."""
        name, module = self.stack.pop(), self.stack.pop()
        self.look_up(module, name)

    def look_up(self, module: str, name: str) -> None:
        """Push a constructor, if it is one of ours."""
        if not (isinstance(module, str) and isinstance(name, str)):
            raise ValueError("a global that is named by something else than text")
        module = {"__builtin__": "builtins", "copy_reg": "copyreg"}.get(module, module)
        if (module, name) not in self.constructors:
            raise RefusedError(f"asks for {module}.{name}, which no data needs")
        self.stack.append(self.constructors[module, name])

    def call(self, _: object) -> None:
        """REDUCE, NEWOBJ: a value, or the draft of one, by a constructor of ours."""
        arguments, constructor = self.stack.pop(), self.stack.pop()
        if not isinstance(constructor, Constructor):
            raise RefusedError("calls something that is no constructor of data")
        if not isinstance(arguments, tuple):
            raise ValueError(f"{constructor.what} made from no tuple")
        self.stack.append(constructor.make(*arguments))

    def build(self, _: object) -> None:
        """BUILD: the state that completes a draft takes its place."""
        state, draft = self.stack.pop(), self.stack.pop()
        if not isinstance(draft, Draft):
            raise RefusedError("changes the inside of something that is complete")
        value = draft.finish(state)
        for number in draft.places:
            self.memo[number] = value
        self.stack.append(value)

    def extend(self, values: list[Any]) -> None:
        """APPEND, APPENDS."""
        _expect(self.stack[-1], list).extend(values)

    def put(self, values: list[Any]) -> None:
        """SETITEM, SETITEMS."""
        _expect(self.stack[-1], dict).update(_pairs(values))

    def add(self, values: list[Any]) -> None:
        """ADDITEMS."""
        _expect(self.stack[-1], set).update(_keys(values))

    def refer(self, _: object) -> None:
        """BINPERSID."""
        if not self.persistent:
            raise RefusedError("refers to something outside itself")


def _instructions(stream: io.BytesIO) -> Iterator[tuple[str, Any]]:
    for count, (code, argument, _) in enumerate(pickletools.genops(stream)):
        if count > MOST_INSTRUCTIONS:
            raise ValueError(f"it has more than {MOST_INSTRUCTIONS} instructions")
        yield code.name, argument


def _expect(value: object, kind: type) -> Any:  # noqa: ANN401 the kind asked for
    # Not isinstance: a subclass could have methods of its own.
    if type(value) is not kind:
        raise ValueError(f"{type(value).__name__} where a {kind.__name__} should be")
    return value


def _pairs(values: list[Any]) -> list[tuple[Any, Any]]:
    return list(zip(_keys(values[::2]), values[1::2], strict=True))


def _keys(values: list[Any]) -> list[Any]:
    # A tuple in a tuple in a tuple ... overflows the C stack where it is hashed.
    for value in values:
        if not isinstance(value, _SCALARS):
            raise ValueError(f"{type(value).__name__} as a key")
    return values


def _push(make: Callable[[_Machine], Any]) -> Callable[[_Machine, Any], None]:
    def push(machine: _Machine, _: object) -> None:
        value = make(machine)  # First: to take what follows a mark exchanges the stack.
        machine.stack.append(value)

    return push


def _tuple_of(count: int) -> Callable[[_Machine, Any], None]:
    def take(machine: _Machine, _: object) -> None:
        if len(machine.stack) < count:
            raise IndexError("a tuple of values that are not there")
        machine.stack[-count:] = [tuple(machine.stack[-count:])]

    return take


_LITERALS = frozenset(
    "NONE NEWTRUE NEWFALSE INT BININT BININT1 BININT2 LONG LONG1 LONG4 FLOAT BINFLOAT UNICODE "
    "BINUNICODE SHORT_BINUNICODE BINUNICODE8 BINBYTES SHORT_BINBYTES BINBYTES8 BYTEARRAY8".split()
)
_IDLE = frozenset(("PROTO", "FRAME", "STOP"))
_CONSTANTS = {"NONE": None, "NEWTRUE": True, "NEWFALSE": False}
_STEPS: dict[str, Callable[[_Machine, Any], None]] = {
    "MARK": _Machine.mark,
    "POP": lambda machine, _: machine.stack.pop(),
    "POP_MARK": lambda machine, _: machine.since_mark(),
    "EMPTY_LIST": _push(lambda machine: []),
    "EMPTY_DICT": _push(lambda machine: {}),
    "EMPTY_SET": _push(lambda machine: set()),
    "EMPTY_TUPLE": _push(lambda machine: ()),
    "TUPLE1": _tuple_of(1),
    "TUPLE2": _tuple_of(2),
    "TUPLE3": _tuple_of(3),
    "TUPLE": _push(lambda machine: tuple(machine.since_mark())),
    "LIST": _push(lambda machine: machine.since_mark()),
    "DICT": _push(lambda machine: dict(_pairs(machine.since_mark()))),
    "FROZENSET": _push(lambda machine: frozenset(_keys(machine.since_mark()))),
    "APPEND": lambda machine, _: machine.extend([machine.stack.pop()]),
    "APPENDS": lambda machine, _: machine.extend(machine.since_mark()),
    "SETITEM": lambda machine, _: machine.put([machine.stack.pop(-2), machine.stack.pop()]),
    "SETITEMS": lambda machine, _: machine.put(machine.since_mark()),
    "ADDITEMS": lambda machine, _: machine.add(machine.since_mark()),
    "MEMOIZE": _Machine.remember,
    "PUT": _Machine.remember,
    "BINPUT": _Machine.remember,
    "LONG_BINPUT": _Machine.remember,
    "GET": _Machine.recall,
    "BINGET": _Machine.recall,
    "LONG_BINGET": _Machine.recall,
    "GLOBAL": _Machine.name_global,
    "STACK_GLOBAL": _Machine.name_stacked_global,
    "REDUCE": _Machine.call,
    "NEWOBJ": _Machine.call,
    "BUILD": _Machine.build,
    "BINPERSID": _Machine.refer,
}
