"""Playable Environments for Blender: open a picture, key actions, film it.

Importing this package is cheap and needs no Blender; `register()` loads the parts that do.
"""

from .registration import in_order


def _parts() -> tuple:
    """The modules that register something, in an order in which each finds its predecessors."""
    from . import (
        framing,
        installing,
        keeping,
        overlay,
        overrides,
        playing,
        preview,
        settings,
        strips,
        translations,
    )
    from .filming import engine, exact_colours, written_files
    from .worker import session

    return (
        settings,
        session,
        installing,
        exact_colours,
        preview,
        written_files,
        engine,
        framing,
        playing,
        overlay,
        strips,
        overrides,
        keeping,
        translations,
    )


register, unregister = in_order(_parts)
