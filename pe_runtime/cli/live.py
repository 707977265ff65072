"""The live loop of `pe play`: keys or lines in, frames and a screen out."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console

from pe_runtime.cli.interrupts import exit_on_terminate
from pe_runtime.cli.keyboard import Keys, Lines, has_single_keys, single_keys
from pe_runtime.cli.screen import Drawn, KeyScreen, LineScreen, Screen
from pe_runtime.cli.terminal import progress
from pe_runtime.contract.errors import ShotError
from pe_runtime.play.commands import Command, command_of_key, commands_of_word
from pe_runtime.play.live import LivePlay, SavedTake
from pe_runtime.play.session import Moment


def play_live(live: LivePlay, mp4: bool, preview: bool) -> tuple[list[SavedTake], bool]:
    """Let somebody play until they quit, and save every take.

    Args:
        live: The session with its files.
        mp4: Film every take.
        preview: Show pictures in the terminal.

    Returns:
        The takes, and whether Ctrl-C ended the session; then the last take has the frames that
        were drawn until then.

    Raises:
        ShotError: A written list of commands has one that makes no sense; the take until there is
            kept.
    """
    loop = LiveLoop(live, mp4)
    try:
        with exit_on_terminate(), _terminal(preview) as (source, screen):
            loop.follow(source, screen, forgiving=sys.stdin.isatty())
        with progress("frames") as report:
            loop.saved.append(live.save(loop.filming, report))
    except KeyboardInterrupt:
        return [*loop.saved, live.abandon()], True
    except BaseException:
        live.abandon()
        raise
    return loop.saved, False


@contextmanager
def _terminal(preview: bool) -> Iterator[tuple[Keys | Lines, Screen]]:
    """Where commands come from and moments are shown: single keys if possible, else lines."""
    console = Console(stderr=True, highlight=False)
    keys_work = has_single_keys(sys.stdin) and console.is_terminal and not console.is_dumb_terminal
    if keys_work:
        with single_keys(sys.stdin) as keys, KeyScreen(console, preview) as screen:
            yield keys, screen
        return
    yield Lines(sys.stdin), LineScreen(console, preview, sys.stdin.isatty())


class LiveLoop:
    """Follows commands until one of them ends the session.

    Args:
        live: The session with its files.
        mp4: Film every take.
    """

    def __init__(self, live: LivePlay, mp4: bool) -> None:
        self._live = live
        self._mp4 = mp4
        self._shown: Moment | None = None
        self.filming = mp4
        """Whether the take that is being played gets a film."""
        self.saved: list[SavedTake] = []

    def follow(self, source: Keys | Lines, screen: Screen, forgiving: bool) -> None:
        """Obey what comes from a source until it ends or says quit.

        Args:
            source: Keys or words.
            screen: Where moments are shown.
            forgiving: Say what makes no sense and go on, as for somebody who types.

        Raises:
            ShotError: Something makes no sense and nobody is there to be told.
        """
        self._draw(screen)
        for word in source:
            try:
                for command in self._commands(source, word):
                    if command.verb == "quit":
                        return
                    self._perform(command, source, screen)
            except ShotError as problem:
                if not forgiving:
                    raise
                screen.say(str(problem), self._live.session)

    def _commands(self, source: Keys | Lines, word: str) -> tuple[Command, ...]:
        session = self._live.session
        names = session.stage.names(session.player)
        by_key = isinstance(source, Keys)
        return (command_of_key(word, names),) if by_key else commands_of_word(word, names)

    def _perform(self, command: Command, source: Keys | Lines, screen: Screen) -> None:
        if command.verb == "keys":
            screen.toggle_keys()
        elif command.verb == "film":
            self._film(screen)
        else:
            self._change(command, source, screen)

    def _film(self, screen: Screen) -> None:
        self.filming = True
        screen.say(f"saved {self._save(screen).video}", self._live.session)

    def _save(self, screen: Screen) -> SavedTake:
        def report(done: int, total: int) -> None:
            screen.say(f"{done} of {total} frames", self._live.session)

        return self._live.save(self.filming, report)

    def _change(self, command: Command, source: Keys | Lines, screen: Screen) -> None:
        if command.verb == "new":
            self.saved.append(self._save(screen))
            self.filming = self._mp4
        steps = self._live.session.steps
        self._live.do(command)
        session = self._live.session
        if session.now is self._shown:
            screen.say("", session)
        elif session.steps > steps or not source.waiting():
            # A camera key that is held down sends more than can be drawn: only the last one is.
            self._draw(screen)

    def _draw(self, screen: Screen) -> None:
        began = time.perf_counter()
        path, picture = self._live.draw()
        self._shown = self._live.session.now
        screen.show(Drawn(self._live.session, path, picture, time.perf_counter() - began))
