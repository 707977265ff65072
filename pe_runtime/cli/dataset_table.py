"""Facts of data sets as a table: a line for each fact, a column for each split."""

from collections.abc import Callable, Mapping

from rich.table import Table

from pe_runtime.curation.facts import DatasetFacts, PlayerFacts

_LINES: dict[str, Callable[[DatasetFacts], str]] = {
    "scene": lambda facts: facts.info.scene,
    "seed": lambda facts: str(facts.info.seed),
    "complete episodes": lambda facts: f"{facts.episodes} of {facts.info.count}",
    "frames": lambda facts: str(facts.pictures),
    "views": lambda facts: str(facts.info.views),
    "size": lambda facts: f"{facts.info.width}x{facts.info.height}",
    "steps per second": lambda facts: f"{facts.info.steps_per_second:g}",
    "on disk": lambda facts: f"{facts.bytes / 1e6:.1f} MB",
    "noise": lambda facts: _named(facts.noise, "{:g}"),
}


def as_facts_table(title: str, facts: Mapping[str, DatasetFacts]) -> Table:
    """The facts of one data set (named "") or of several splits."""
    table = Table(title=title, title_justify="left")
    for heading in ("", *facts):
        table.add_column(heading)
    for label, tell in _LINES.items():
        table.add_row(label, *(tell(each) for each in facts.values()))
    names = dict.fromkeys(name for each in facts.values() for name in each.players)
    for name in names:
        table.add_section()
        players = [each.players.get(name) for each in facts.values()]
        for label, tell in _PLAYER_LINES.items():
            table.add_row(f"{name} {label}", *(tell(p) if p else "" for p in players))
    return table


def _heights(player: PlayerFacts) -> str:
    return " / ".join(f"{height:.0f}" for height in player.heights) + " px" * bool(player.heights)


def _named(values: Mapping[str, float], form: str) -> str:
    return "\n".join(f"{name} {form.format(value)}" for name, value in values.items())


_PLAYER_LINES: dict[str, Callable[[PlayerFacts], str]] = {
    "present": lambda player: f"{player.present:.1%}",
    "height, smallest / median / largest": _heights,
    "actions": lambda player: _named(player.actions, "{:.0%}"),
}
