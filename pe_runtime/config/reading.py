"""Configuration dataclasses from TOML, JSON or plain values, with errors that name the key.

A key that no dataclass knows is an error that names the nearest known key; a number that makes no
sense is an error that names the key.
"""

import dataclasses
import difflib
import math
import tomllib
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pe_runtime.contract.errors import ConfigError


def read_toml(path: str | Path, section: str, kind: type) -> Any:  # noqa: ANN401
    """Read one section of a TOML file into a configuration dataclass.

    Args:
        path: TOML file.
        section: Name of the top-level table; absent means all defaults.
        kind: Dataclass to build.

    Raises:
        ConfigError: The file cannot be read, a key is unknown, or a value has the wrong type.
    """
    try:
        document = tomllib.loads(Path(path).read_text())
    except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError) as problem:
        raise ConfigError(f"cannot read the configuration {path}: {problem}") from problem
    return from_dict(kind, document.get(section, {}), section)


def from_dict(kind: type, values: object, where: str = "config") -> Any:  # noqa: ANN401
    """Build a configuration dataclass from plain values (parsed TOML or JSON).

    Raises:
        ConfigError: A key is unknown (the nearest known one is named), missing or of a wrong type.
    """
    if not isinstance(values, Mapping):
        raise ConfigError(f"{where}: expected a table of settings, found {values!r}")
    known = {each.name: each for each in dataclasses.fields(kind)}
    hints = typing.get_type_hints(kind)
    for key in values:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else f"; known: {', '.join(known)}"
            raise ConfigError(f"{where}: unknown key {key!r}{hint}")
    missing = [name for name, each in known.items() if _required(each) and name not in values]
    if missing:
        raise ConfigError(f"{where}: missing key {missing[0]!r}")
    built = {key: _convert(hints[key], value, f"{where}.{key}") for key, value in values.items()}
    return kind(**built)


def as_dict(config: Any) -> dict[str, Any]:  # noqa: ANN401
    """The configuration as JSON-able values; `from_dict` reads it back."""
    return dataclasses.asdict(config)


def _required(each: dataclasses.Field) -> bool:
    no_default = each.default is dataclasses.MISSING
    return no_default and each.default_factory is dataclasses.MISSING


def _convert(hint: Any, value: Any, where: str) -> Any:  # noqa: ANN401
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is types.UnionType:
        return None if value is None else _convert(arguments[0], value, where)
    if dataclasses.is_dataclass(hint):
        return from_dict(hint, value, where)
    if origin is tuple:
        return _convert_tuple(arguments, value, where)
    if hint is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if origin is not None:
        return _convert_table(arguments[1], value, where)
    if not isinstance(value, hint) or (hint is int and isinstance(value, bool)):
        raise ConfigError(f"{where}: expected {hint.__name__}, found {value!r}")
    if hint is float and not math.isfinite(value):
        raise ConfigError(f"{where}: expected a finite number, found {value!r}")
    return value


def _convert_table(hint: Any, value: Any, where: str) -> dict[str, Any]:  # noqa: ANN401
    if not isinstance(value, Mapping):
        raise ConfigError(f"{where}: expected a table, found {value!r}")
    return {key: _convert(hint, each, f"{where}.{key}") for key, each in value.items()}


def _convert_tuple(arguments: tuple[Any, ...], value: Any, where: str) -> tuple:  # noqa: ANN401
    if not isinstance(value, list | tuple):
        raise ConfigError(f"{where}: expected a list, found {value!r}")
    if arguments[-1] is Ellipsis:
        return tuple(_convert(arguments[0], v, f"{where}[{i}]") for i, v in enumerate(value))
    if len(value) != len(arguments):
        raise ConfigError(f"{where}: expected {len(arguments)} values, found {len(value)}")
    return tuple(_convert(arguments[i], v, f"{where}[{i}]") for i, v in enumerate(value))
