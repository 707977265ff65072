"""What somebody who plays in a terminal sees: the picture, the keys, and a line about now."""

from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import numpy as np
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from pe_runtime.cli.preview import Preview, can_preview
from pe_runtime.play.commands import KEYS
from pe_runtime.play.session import Session

COLUMN = 25
"""Characters of one column of the legend."""
SPARE_ROWS = 3
"""Lines under picture and legend: two of words, one for the cursor."""


@dataclass(frozen=True)
class Drawn:
    """A drawn moment.

    Attributes:
        session: The session at that moment.
        path: The file.
        picture: (height, width, 3) in [0, 1].
        seconds: How long drawing took.
    """

    session: Session
    path: Path
    picture: np.ndarray
    seconds: float


class KeyScreen:
    """A screen that is drawn over in place, for single keys.

    Args:
        console: The terminal.
        preview: Show the picture where the terminal has colours.
    """

    def __init__(self, console: Console, preview: bool) -> None:
        self._console = console
        self._preview = preview and can_preview(console)
        self._live = Live(console=console, auto_refresh=False, transient=False)
        self._keys_shown = True
        self._drawn: Drawn | None = None
        self._words = ""

    def __enter__(self) -> "KeyScreen":
        """Take over the lower part of the terminal."""
        self._live.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Give the terminal back."""
        self._live.__exit__(kind, error, trace)

    def show(self, drawn: Drawn) -> None:
        """Show a new picture."""
        self._drawn, self._words = drawn, ""
        self._refresh()

    def say(self, words: str, session: Session) -> None:
        """Show a line about what just happened or did not."""
        self._words = words
        if self._drawn is not None:
            self._drawn = Drawn(session, self._drawn.path, self._drawn.picture, self._drawn.seconds)
        self._refresh()

    def toggle_keys(self) -> None:
        """Show or hide the legend."""
        self._keys_shown = not self._keys_shown
        self._refresh()

    def _refresh(self) -> None:
        if self._drawn is None:
            return
        parts: list[RenderableType] = []
        keys = [legend(self._drawn.session, self._console.width)] if self._keys_shown else []
        rows = sum(len(self._console.render_lines(each, pad=False)) for each in keys)
        left = self._console.height - rows - SPARE_ROWS
        if self._preview and left > 1:
            parts.append(Preview(self._drawn.picture, self._console.width - 1, left))
        below = Text(f"{self._drawn.path}, {self._drawn.seconds:.2f} s", style="dim")
        if self._words:
            below = Text(self._words, style="yellow")
        for line in (status(self._drawn.session), below):
            line.no_wrap, line.overflow = True, "ellipsis"
            parts.append(line)
        self._live.update(Group(*parts, *keys), refresh=True)


class LineScreen:
    """One line per moment, for typed or written commands.

    Args:
        console: Where to write.
        preview: Show the picture too where the console is a terminal with colours.
        interactive: Somebody is typing: say what can be typed.
    """

    def __init__(self, console: Console, preview: bool, interactive: bool) -> None:
        self._console = console
        self._preview = preview and can_preview(console)
        self._interactive = interactive
        self._greeted = False

    def __enter__(self) -> "LineScreen":
        """Nothing to take over."""
        return self

    def __exit__(self, *failure: object) -> None:
        """Nothing to give back."""

    def show(self, drawn: Drawn) -> None:
        """Write the line of a new picture."""
        if self._interactive and not self._greeted:
            self._greeted = True
            self._console.print(legend(drawn.session, self._console.width))
        if self._preview:
            rows = self._console.height // 2
            self._console.print(Preview(drawn.picture, self._console.width - 1, rows))
        line = Text(f"{drawn.path}: ").append_text(status(drawn.session))
        self._console.print(line, soft_wrap=True)

    def say(self, words: str, session: Session) -> None:
        """Write a line about what just happened or did not."""
        self._console.print(Text(words) if words else status(session), soft_wrap=True)

    def toggle_keys(self) -> None:
        """Write the legend at the next picture."""
        self._greeted, self._interactive = False, True


Screen = KeyScreen | LineScreen


def legend(session: Session, width: int) -> Table:
    """Digits with the learnt actions, then all other keys with what they do."""
    stage, columns = session.stage, max(1, width // COLUMN)
    table = Table.grid(padding=(0, 2))
    actions = [
        (str(number), f"{name} {arrow}")
        for number, (name, arrow) in enumerate(
            zip(stage.names(session.player), session.arrows(), strict=True), start=1
        )
    ]
    others = [(each.keys[0], each.says) for each in KEYS]
    if len(stage.players) == 1:
        others = [each for each in others if each[0] != "tab"]
    for entries in (actions, others):
        cells = [Text.assemble((keys, "bold"), " ", says) for keys, says in entries]
        rows = -(-len(cells) // columns)
        for row in range(rows):
            table.add_row(*cells[row::rows])
    return table


def status(session: Session) -> Text:
    """Who is played, what was done last, how camera and styles stand."""
    stage, now = session.stage, session.now
    who = session.player
    if session.in_turn:
        given = zip(stage.players, session.pending, strict=False)
        who = ", ".join([*(f"{p} {stage.names(p)[a]}" for p, a in given), f"{session.player}?"])
    told = [f"{player} {stage.names(player)[action]}" for player, action in now.told.items()]
    facts = [f"step {session.steps}: {', '.join(told) or 'the start'}"]
    facts += [f"{player} as {mix.object}" for player, mix in now.styles.items()]
    moved = ((now.move.orbit, "°"), (now.move.rise, " m up"), (now.move.dolly, " m nearer"))
    facts += [f"camera {amount:+g}{unit}" for amount, unit in moved if amount]
    return Text.assemble((f"[{who}] ", "bold"), " · ".join(facts))
