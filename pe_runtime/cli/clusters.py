"""The option `--cluster`: draw on several processes or machines."""

from collections.abc import Callable, Sequence
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from pe_runtime.cli.terminal import device

OPTION = "--cluster"
DEFAULT = "local"
Cluster = Annotated[
    str | None,
    typer.Option(
        OPTION,
        metavar="[ADDRESS]",
        help="Draw on Dask workers: local (as many as this machine can use), local:4, or the "
        "address of a scheduler you trust, such as tcp://10.0.0.5:8786; without a value: local.",
    ),
]


class ClusterCommand(TyperCommand):
    """A command whose `--cluster` may stand without a value."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:  # noqa: ANN401 click's or typer's
        """Read the arguments after the missing value is filled in."""
        return super().parse_args(ctx, with_default_place(args))


def with_default_place(arguments: Sequence[str]) -> list[str]:
    """The arguments with `local` behind a `--cluster` that no value follows."""
    filled: list[str] = []
    following = [*arguments, "--"][1:]
    for argument, after in zip(arguments, following, strict=True):
        filled.append(argument)
        # The only other thing that stands free is the shot's file.
        if argument == OPTION and (after.startswith("-") or after.endswith(".json")):
            filled.append(DEFAULT)
    return filled


def drawing_on(cluster: str) -> Callable[..., Any]:
    """What draws a plan's frames on a cluster, as `draw_missing` does in this process.

    Args:
        cluster: What the option says.

    Raises:
        ClusterError: Dask is not installed, or the text says no place.
    """
    from pe_runtime.cluster.connection import parse_place
    from pe_runtime.cluster.spreading import ModelFile, draw_on_cluster
    from pe_runtime.environment import find_model

    place = parse_place(cluster)

    def draw(world: Any, plan: Any, *watching: Any) -> Any:  # noqa: ANN401 as `draw_missing`
        model = ModelFile(find_model(plan.prepared.shot.model), device())
        return draw_on_cluster(place, plan, model, *watching)

    return draw
