"""What all commands share: results on stdout, all else on stderr, and the shared options."""

import functools
import inspect
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import asdict, dataclass
from typing import Annotated, Any

import typer
from rich.console import Console, RenderableType
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from pe_runtime.contract.errors import ShotError


@dataclass(frozen=True)
class SharedOptions:
    """What every command with a result understands."""

    as_json: bool = False
    device: str = "auto"


_OPTIONS = {
    "as_json": Annotated[bool, typer.Option("--json", help="Print the result as JSON.")],
    "device": Annotated[str, typer.Option(help="Where networks run: auto, cpu or cuda.")],
}
_given: ContextVar[SharedOptions] = ContextVar("shared options")


def shared(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options `--json` and `--device` beside its own."""

    @functools.wraps(command)
    def run(*, as_json: bool = False, device: str = "auto", **own: Any) -> None:  # noqa: ANN401
        _given.set(SharedOptions(as_json, device))
        command(**own)

    signature = inspect.signature(command)
    added = [
        inspect.Parameter(
            name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=_OPTIONS[name]
        )
        for name, default in asdict(SharedOptions()).items()
    ]
    # Typer reads the signature and the annotations to build the options.
    run.__signature__ = signature.replace(parameters=[*signature.parameters.values(), *added])
    run.__annotations__ = command.__annotations__ | _OPTIONS
    return run


def device() -> str:
    """The device that was asked for."""
    return _given.get(SharedOptions()).device


WIDEST = 400
"""Columns that a table may take."""


def show(result: Mapping[str, Any], view: RenderableType | None = None) -> None:
    """Print a command's result: JSON if asked for, else the view or its keys and values."""
    if _given.get(SharedOptions()).as_json:
        typer.echo(json.dumps(result, indent=1, allow_nan=False))
        return
    console = Console(soft_wrap=True, highlight=False)
    if view is not None:
        # In a narrow window, or a file, long lines are better than columns left out.
        needed = console.measure(view, options=console.options.update(width=WIDEST)).maximum
        console.width = max(console.width, needed)
        console.print(view)
        return
    for key, value in result.items():
        text = value if isinstance(value, str) else json.dumps(value)
        console.print(f"{key.replace('_', ' ')}: {text}", markup=False)


def note(text: str) -> None:
    """A line about what is going on."""
    typer.echo(text, err=True)


def complain(error: Exception) -> None:
    """The one line of a failure."""
    typer.echo("pe: " + " ".join(str(error).split()), err=True)


@contextmanager
def progress(label: str) -> Iterator[Callable[[int, int], None]]:
    """A progress bar on stderr, as a function of the number done and the total."""
    console = Console(stderr=True)
    columns = (TextColumn(label), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        task = bar.add_task(label, total=None)

        def report(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)

        yield report


def parse_size(text: str) -> tuple[int, int]:
    """`256x144` as width and height.

    Raises:
        typer.BadParameter: It is no size.
    """
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise typer.BadParameter(f"expected a size such as 256x144, found {text!r}")
    return int(width), int(height)


def parse_frames(text: str) -> list[int]:
    """`1-24,30` as frame numbers.

    Raises:
        ShotError: It is no list of frames.
    """
    frames: list[int] = []
    for part in text.split(","):
        first, dash, last = (piece.strip() for piece in part.partition("-"))
        if not first.isdecimal() or (dash and not last.isdecimal()):
            raise ShotError(f"frames: expected a list such as 1-24,30, found {text!r}")
        frames += range(int(first), int(last if dash else first) + 1)
    return frames
