"""Options of a command that belong together, as one dataclass per group."""

import functools
import inspect
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any


def grouped(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command one option per field of each dataclass among its parameters.

    The fields say their help as parameters do: `fps: Annotated[float, typer.Option(...)] = 5.0`.
    """
    groups, flat, annotations = {}, [], {}
    for parameter in inspect.signature(command).parameters.values():
        if not is_dataclass(parameter.annotation):
            flat.append(parameter)
            continue
        groups[parameter.name] = parameter.annotation
        flat += [
            inspect.Parameter(
                each.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=each.default,
                annotation=each.type,
            )
            for each in fields(parameter.annotation)
        ]
    flat.sort(key=lambda parameter: parameter.kind)

    @functools.wraps(command)
    def run(**given: Any) -> None:  # noqa: ANN401
        made = {
            name: group(**{each.name: given.pop(each.name) for each in fields(group)})
            for name, group in groups.items()
        }
        command(**given, **made)

    for parameter in flat:
        annotations[parameter.name] = parameter.annotation
    # Typer reads the signature and the annotations to build the options.
    run.__signature__ = inspect.Signature(flat)
    run.__annotations__ = annotations | {"return": None}
    return run
