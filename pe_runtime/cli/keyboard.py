"""Single keys from a terminal, without echo and without Enter; lines where there is no terminal."""

import os
import select
from collections.abc import Iterator
from contextlib import contextmanager
from io import TextIOBase

from pe_runtime.play.commands import words_of_line

try:
    import termios
    import tty
except ImportError:  # Windows: keys are typed as lines there.
    termios = tty = None

ESCAPE = b"\x1b"
NAMES = {
    b"\t": "tab",
    b" ": "space",
    b"\x7f": "backspace",
    b"\b": "backspace",
    b"\x1b[A": "↑",
    b"\x1b[B": "↓",
    b"\x1b[C": "→",
    b"\x1b[D": "←",
    b"\x1bOA": "↑",
    b"\x1bOB": "↓",
    b"\x1bOC": "→",
    b"\x1bOD": "←",
}
"""Keys that are no letters, as terminals send them in either of their modes."""
SEQUENCE_SECONDS = 0.05
"""Wait for the rest of a key that is sent as several bytes."""
END = b"\x04"
"""Ctrl-D."""


def has_single_keys(stream: TextIOBase) -> bool:
    """Whether keys can be read from a stream one by one."""
    return termios is not None and stream.isatty()


class Keys:
    """Pressed keys, in order, until Ctrl-D or the end of the terminal.

    Args:
        descriptor: File descriptor of a terminal that gives single keys.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor

    def __iter__(self) -> Iterator[str]:
        """Wait for each key in turn."""
        while (sent := self._key()) not in (b"", END):
            name = NAMES.get(sent, sent.decode("ascii", errors="replace"))
            if name.isprintable():
                yield name

    def waiting(self) -> bool:
        """Whether another key has been pressed already."""
        return self._more(0.0)

    def _key(self) -> bytes:
        """One key: a byte, or the whole sequence that stands for it."""
        key = os.read(self._descriptor, 1)
        while key.startswith(ESCAPE) and not _is_whole(key) and self._more(SEQUENCE_SECONDS):
            key += os.read(self._descriptor, 1)
        return key

    def _more(self, seconds: float) -> bool:
        return bool(select.select([self._descriptor], [], [], seconds)[0])


def _is_whole(sequence: bytes) -> bool:
    """Whether an escape sequence has come to its last byte."""
    introduced = sequence[1:2] in (b"[", b"O")
    return len(sequence) > 2 and 0x40 <= sequence[-1] <= 0x7E if introduced else len(sequence) > 1


class Lines:
    """Words of typed lines, in order, until the stream ends.

    Args:
        stream: Where they are typed.
    """

    def __init__(self, stream: TextIOBase) -> None:
        self._stream = stream

    def __iter__(self) -> Iterator[str]:
        """Wait for each line in turn."""
        for line in self._stream:
            yield from words_of_line(line)

    def waiting(self) -> bool:
        """A written list of commands is followed word by word."""
        return False


@contextmanager
def single_keys(stream: TextIOBase) -> Iterator[Keys]:
    """Keys one by one; whatever happens, the terminal is afterwards as it was before."""
    descriptor = stream.fileno()
    before = termios.tcgetattr(descriptor)
    try:
        tty.setcbreak(descriptor)
        yield Keys(descriptor)
    finally:
        # Keys pressed but not read are dropped: the shell must not get them.
        termios.tcsetattr(descriptor, termios.TCSAFLUSH, before)
