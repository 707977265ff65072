"""The values that the release's pickles may hold, and how each is made from plain data.

Whatever a pickle names is looked up here and nowhere else. Arrays are not handed to numpy's own
constructors, which believe what a file says of itself: shapes, types and sizes are checked first.
"""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

MOST_AXES = 8
LARGEST_TENSOR = 4096


class RefusedError(ValueError):
    """A pickle asks for something that data does not need."""


@dataclass(frozen=True, eq=False)
class Pose:
    """One of the release's poses, object or camera to world, in its own conventions.

    Attributes:
        rotation: (3,) float64 Euler angles about x, y and z, radians.
        translation: (3,) float64, metres.
    """

    rotation: np.ndarray
    translation: np.ndarray


@dataclass(frozen=True)
class Constructor:
    """What a pickle may name: how to make one kind of value, called `what`."""

    what: str
    make: Callable[..., Any]


@dataclass
class Draft:
    """A value that only its state completes; `places` are its numbers in the pickle's memory."""

    finish: Callable[[object], Any]
    places: list[int] = field(default_factory=list)


def array_of_storage(described: object, count: int, content: bytes) -> np.ndarray:
    """The numbers of a stored tensor.

    Args:
        described: ("storage", constructor of its numbers, key, place, count, None).
        count: How many numbers follow.
        content: Their bytes, little-endian.
    """
    if not (isinstance(described, tuple) and len(described) > 1):
        raise ValueError("a tensor without a description")
    kind = described[1]
    if described[0] != "storage" or not isinstance(kind, Constructor):
        raise ValueError("a tensor of no known numbers")
    numbers = np.frombuffer(content, kind.make())
    if len(numbers) != count:
        raise ValueError(f"a tensor of {len(numbers)} numbers that says it has {count}")
    return numbers


def doubled(numbers: np.ndarray) -> np.ndarray:
    """A copy as float64, whatever it holds: a NaN that signals would warn."""
    with np.errstate(invalid="ignore"):
        return numbers.astype(np.float64)


def _array(kind: object, *_: object) -> Draft:
    if kind is not _NDARRAY:
        raise RefusedError("makes an array that is no plain numpy array")
    return Draft(_finished_array)


def _finished_array(state: object) -> np.ndarray:
    """State of an array: (version, shape, type, whether in Fortran's order, bytes)."""
    _, shape, kind, fortran, content = _tuple(state)
    return _shaped(content, kind, shape, "F" if fortran else "C")


def _array_of_buffer(content: object, kind: object, shape: object, order: object) -> np.ndarray:
    return _shaped(content, kind, shape, "F" if order == "F" else "C")


def _shaped(content: object, kind: object, shape: object, order: str) -> np.ndarray:
    if not isinstance(kind, np.dtype) or not isinstance(content, bytes | bytearray):
        raise RefusedError("makes an array of something else than plain numbers")
    return np.frombuffer(content, kind).reshape(_sizes(shape), order=order)


def _type(code: object, *_: object) -> Draft:
    """A number type: booleans, integers and floats; no objects, texts or records."""
    if not (isinstance(code, str) and re.fullmatch("b1|[iu][1248]|f[248]", code)):
        raise RefusedError(f"makes an array of type {code!r:.40}, which is no plain number")
    return Draft(lambda state: np.dtype(code).newbyteorder(_byte_order(state)))


def _byte_order(state: object) -> str:
    order = _tuple(state)[1]
    if order not in ("<", ">", "|", "="):
        raise ValueError("a number type without byte order")
    return order


def _number(kind: object, content: object) -> np.generic:
    return _shaped(content, kind, (1,), "C")[0]


def _pose() -> Draft:
    return Draft(_finished_pose)


def _finished_pose(state: object) -> Pose:
    if not isinstance(state, dict):
        raise ValueError("a pose without attributes")
    parts = {name: _vector(name, state.get(name)) for name in ("rotation", "translation")}
    return Pose(**parts)


def _vector(name: str, found: object) -> np.ndarray:
    if not isinstance(found, np.ndarray) or found.size != 3:
        raise ValueError(f"a pose whose {name} is no array of 3 numbers")
    return doubled(found.reshape(3))


def _tensor(
    storage: object, offset: object, shape: object, strides: object, *_: object
) -> np.ndarray:
    """A tensor as an array: numbers of a storage, picked by offset and strides (in numbers)."""
    shape, strides, (offset,) = _sizes(shape), _sizes(strides), _sizes((offset,))
    if not isinstance(storage, np.ndarray) or len(strides) != len(shape):
        raise ValueError("a tensor without numbers")
    # Strides of 0 make much of little; poses have three numbers.
    if not 0 < math.prod(shape) <= LARGEST_TENSOR:
        raise ValueError(f"a tensor of {math.prod(shape)} numbers, where poses have 3")
    places = np.full((), offset, np.int64)
    for size, stride in zip(shape, strides, strict=True):
        places = places[..., None] + np.arange(size, dtype=np.int64) * stride
    return storage[places]


def _sizes(found: object) -> tuple[int, ...]:
    sizes = _tuple(found)
    if len(sizes) > MOST_AXES or not all(type(size) is int and 0 <= size < 2**40 for size in sizes):
        raise ValueError("a shape that is none")
    return sizes


def _tuple(found: object) -> tuple:
    if not isinstance(found, tuple):
        raise ValueError(f"{type(found).__name__} where a tuple should be")
    return found


def _encoded(text: object, encoding: object = "latin1") -> bytes:
    """Bytes, which old pickles write as a text and how to encode it."""
    if isinstance(text, bytes):
        return text
    if not isinstance(text, str) or encoding not in ("latin1", "latin-1"):
        raise ValueError("bytes that are no text in latin1")
    return text.encode("latin1")


def _scalars(values: object = ()) -> list:
    if not isinstance(values, list | tuple) or any(
        not isinstance(value, str | bytes | int | float | None) for value in values
    ):
        raise ValueError("a set of something else than numbers and texts")
    return list(values)


def _refused_call(*_: object) -> None:
    raise RefusedError("makes an array in a way that no release of numpy does")


def _constructors() -> dict[tuple[str, str], Constructor]:
    pose = Constructor("a pose", _pose)
    found = {
        ("numpy", "ndarray"): _NDARRAY,
        ("numpy", "dtype"): Constructor("a number type", _type),
        ("torch._utils", "_rebuild_tensor_v2"): Constructor("a tensor", _tensor),
        ("utils.lib_3d.pose_parameters", "PoseParametersNumpy"): pose,
        ("utils.lib_3d.pose_parameters", "PoseParameters"): pose,
        ("_codecs", "encode"): Constructor("bytes", _encoded),
        ("builtins", "bytes"): Constructor("bytes", lambda: b""),
        ("builtins", "bytearray"): Constructor("bytes", _encoded),
        ("builtins", "set"): Constructor("a set", lambda *values: set(_scalars(*values))),
        ("builtins", "frozenset"): Constructor("a set", lambda *v: frozenset(_scalars(*v))),
        ("collections", "OrderedDict"): Constructor("a dictionary", lambda: {}),
    }
    # numpy 2 renamed the folder; files of either are read, whichever is installed.
    for folder in ("numpy.core", "numpy._core"):
        found[f"{folder}.multiarray", "_reconstruct"] = Constructor("an array", _array)
        found[f"{folder}.multiarray", "scalar"] = Constructor("a number", _number)
        found[f"{folder}.numeric", "_frombuffer"] = Constructor("an array", _array_of_buffer)
    return found


_NDARRAY = Constructor("an array", _refused_call)
CONSTRUCTORS = MappingProxyType(_constructors())
"""(module, name) as pickles write them -> what is made instead of calling it."""

STORAGES = MappingProxyType(
    {
        ("torch", "FloatStorage"): Constructor("numbers", lambda: np.dtype("<f4")),
        ("torch", "DoubleStorage"): Constructor("numbers", lambda: np.dtype("<f8")),
    }
)
"""The same inside a stored tensor."""
