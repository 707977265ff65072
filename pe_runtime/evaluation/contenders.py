"""Which models stand in which rows: one model, or a folder of runs."""

from collections.abc import Mapping
from pathlib import Path

from pe_runtime.contract.errors import ConfigError
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.evaluation.comparison import TABLES, Contender
from pe_runtime.evaluation.paper_tables import ABLATIONS
from pe_runtime.evaluation.subject import acts

ALL = "all"
FILES = ("model.safetensors", "synthesis.safetensors")
"""What a run folder may hold; the first that is there is measured."""
ACTION_FILES = FILES[:1]


def contenders_of(
    table: str, runs: Path | None, model: str, device: str = "auto"
) -> list[Contender]:
    """The rows of a table.

    Args:
        table: One of `TABLES`.
        runs: Folder with one sub-folder per row, named after it; None for a single model.
        model: Name or file of that model.
        device: Where networks run.

    Raises:
        ConfigError: There is no such table, or no run for it.
    """
    if table not in TABLES:
        raise ConfigError(f"table must be one of {', '.join([*TABLES, ALL])}, found {table!r}")
    if runs is None:
        return [_contender(Path(model).stem, model, device)]
    found = run_files(runs, table)
    if not found:
        raise ConfigError(
            f"{runs} holds no run for the table {table!r}: expected folders with "
            f"{' or '.join(files_for(table))}"
            + (f", named {', '.join(ABLATIONS[table][0])}" if table in ABLATIONS else "")
        )
    return [_contender(name, str(file), device) for name, file in found.items()]


def run_files(runs: Path, table: str) -> dict[str, Path]:
    """The model file of each run folder, in the paper's order where the table has one."""
    found: dict[str, Path] = {}
    for folder in sorted(path for path in runs.iterdir() if path.is_dir()):
        files = [folder / name for name in files_for(table) if (folder / name).is_file()]
        if files:
            found[folder.name] = files[0]
    order: Mapping[str, object] = ABLATIONS.get(table, ({}, {}))[0]
    return {n: found[n] for n in order if n in found} if order else found


def files_for(table: str) -> tuple[str, ...]:
    """Files that may stand in a table's rows."""
    return ACTION_FILES if TABLES[table] in ("playability", "long-play") else FILES


def fitting_tables(
    table: str, runs: Path | None, model: str, device: str = "auto", views: int = 2
) -> list[str]:
    """The tables behind a name; for "all" those that models and data can fill.

    Args:
        table: One of `TABLES`, or "all".
        runs: Folder with one sub-folder per row; None for a single model.
        model: Name or file of that model.
        device: Where networks run.
        views: Cameras that recorded the data.

    Raises:
        ConfigError: There is no run at all.
    """
    if table != ALL:
        return [table]
    drawable = [name for name in TABLES if name != "camera" or views > 1]
    if runs is None:
        plays = acts(PlayableEnvironment.load(model, device))
        single = [name for name in drawable if name not in ABLATIONS]
        return [name for name in single if plays or files_for(name) == FILES]
    fitting = [name for name in drawable if run_files(runs, name)]
    if not fitting:
        raise ConfigError(f"{runs} holds no folder with {' or '.join(FILES)}")
    return fitting


def _contender(name: str, file: str, device: str) -> Contender:
    return Contender(name, lambda: PlayableEnvironment.load(file, device))
