"""What can be asked for while playing: keys and words, and the commands they mean."""

from collections.abc import Sequence
from dataclasses import dataclass

from pe_runtime.contract.errors import ShotError
from pe_runtime.shots.action_text import is_run, parse_run


@dataclass(frozen=True)
class Command:
    """One thing asked for.

    Attributes:
        verb: What to do; see `KEYS`, or "act".
        amount: Action index of "act"; -1 or 1 for the direction of a camera move.
    """

    verb: str
    amount: int = 0


@dataclass(frozen=True)
class Key:
    """A command with its keys.

    Attributes:
        keys: What a keyboard gives; the legend shows the first.
        words: The same as typed words.
        says: What it does, for the legend.
        command: The command.
    """

    keys: tuple[str, ...]
    words: tuple[str, ...]
    says: str
    command: Command


KEYS = (
    Key(("space",), ("again",), "once more", Command("again")),
    Key(("tab",), ("player",), "next player or all", Command("player")),
    Key(("←", "a"), ("orbit-left",), "orbit left", Command("orbit", -1)),
    Key(("→", "d"), ("orbit-right",), "orbit right", Command("orbit", 1)),
    Key(("↑", "w"), ("raise",), "raise camera", Command("rise", 1)),
    Key(("↓", "s"), ("lower",), "lower camera", Command("rise", -1)),
    Key(("+", "="), ("nearer",), "go nearer", Command("dolly", 1)),
    Key(("-",), ("farther",), "go farther", Command("dolly", -1)),
    Key(("c",), ("camera",), "camera back", Command("recentre")),
    Key(("b",), ("borrow",), "borrow style", Command("borrow")),
    Key(("o",), ("own",), "own style", Command("own")),
    Key(("u", "backspace"), ("undo",), "undo", Command("undo")),
    Key(("n",), ("new",), "new take", Command("new")),
    Key(("m",), ("mp4",), "save mp4", Command("film")),
    Key(("?", "h"), ("keys", "help"), "hide keys", Command("keys")),
    Key(("q",), ("quit", "exit"), "save and quit", Command("quit")),
)
"""All keys but the digits, in the order of the legend."""


def command_of_key(key: str, actions: Sequence[str]) -> Command:
    """What a pressed key asks for.

    Args:
        key: A character, or a name such as "tab" or "←".
        actions: Names of the actions of whoever is played; digits mean them.

    Raises:
        ShotError: The key means nothing.
    """
    for each in KEYS:
        if key in each.keys:
            return each.command
    if key.isdecimal():
        return Command("act", parse_run(key, actions)[0])
    raise ShotError(f"no key {key!r} here; ? shows the keys")


def words_of_line(line: str) -> list[str]:
    """The words of a typed line, in order; commas and spaces stand between them."""
    return line.replace(",", " ").split()


def commands_of_word(word: str, actions: Sequence[str]) -> tuple[Command, ...]:
    """What a typed word asks for: an action (`2`, `left`, `2*5`), a key or a command's name.

    Args:
        word: The word.
        actions: Names of the actions of whoever is played.

    Returns:
        One command, or the same one several times.

    Raises:
        ShotError: The word means nothing.
    """
    if is_run(word, actions):
        action, count = parse_run(word, actions)
        return (Command("act", action),) * count
    for each in KEYS:
        if word in each.keys or word.lower() in each.words:
            return (each.command,)
    known = ", ".join(each.words[0] for each in KEYS)
    raise ShotError(
        f"no action, key or word {word!r}; actions: {', '.join(actions)}, or their numbers 1 to "
        f"{len(actions)}; words: {known}"
    )
