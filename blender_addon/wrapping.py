"""Texts as lines that fit into a panel. No `bpy` here."""

import textwrap

SIDEBAR_CHARACTERS = 36
"""What the sidebar shows beside an icon at its usual width."""


def sentence(text: str) -> str:
    """A text that begins as a sentence does; errors do not, since they go on behind others."""
    return text[:1].upper() + text[1:]


def wrapped(text: str, characters: int) -> tuple[str, ...]:
    """A text as lines of at most so many characters."""
    return tuple(line for part in text.splitlines() for line in textwrap.wrap(part, characters))
