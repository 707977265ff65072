"""German, collected from the rooms of the add-on; pure data, so that it is read without Blender."""

from . import (
    german_everywhere,
    german_framing,
    german_installing,
    german_overlay,
    german_overrides,
    german_playing,
    german_rendering,
)

ROOMS = (
    german_everywhere,
    german_framing,
    german_installing,
    german_overlay,
    german_overrides,
    german_playing,
    german_rendering,
)


def words() -> dict[tuple[str, str], str]:
    """German by context and English, as Blender looks it up."""
    return {
        (context, english): said
        for room in ROOMS
        for context, messages in room.MESSAGES.items()
        for english, said in messages.items()
    }
