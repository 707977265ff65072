"""The command line `pe`: the only part of the runtime that prints."""

import sys
from collections.abc import Sequence

import typer

from pe_runtime.cli import (
    datasets,
    doors,
    evaluation,
    extension,
    interop,
    pictures,
    playing,
    training,
)
from pe_runtime.cli.benchmark import bench
from pe_runtime.cli.clusters import ClusterCommand
from pe_runtime.cli.terminal import complain, shared
from pe_runtime.contract.errors import PlayableEnvironmentError


def build_app() -> typer.Typer:
    """All commands, in the order in which the help lists them."""
    app = typer.Typer(
        help="Encode a picture, play the people in it, film it from any camera.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        add_completion=False,
    )
    app.command()(shared(doors.demo))
    app.command()(shared(pictures.info))
    app.command()(shared(pictures.encode))
    app.command()(shared(playing.play))
    app.command(cls=ClusterCommand)(shared(pictures.render))
    app.add_typer(datasets.app, name="dataset")
    app.add_typer(training.app, name="train")
    training.app.command("detector")(shared(evaluation.train_detector))
    app.command()(shared(evaluation.evaluate))
    app.command()(shared(bench))
    app.command()(shared(interop.import_official))
    app.add_typer(extension.app, name="extension")
    app.command()(doors.worker)
    return app


def main(arguments: Sequence[str] | None = None) -> None:
    """Run one command; failures are one line on stderr and exit code 1, wrong usage is 2."""
    try:
        build_app()(args=None if arguments is None else list(arguments), prog_name="pe")
    except (PlayableEnvironmentError, OSError) as error:
        complain(error)
        sys.exit(1)
