"""Rendered frames as strips of the sequencer."""


def _parts() -> tuple:
    from . import lending, operators, panels, strip_operators

    return lending, operators, strip_operators, panels


def register() -> None:
    """Register the parts in order."""
    for part in _parts():
        part.register()


def unregister() -> None:
    """Undo `register`."""
    for part in reversed(_parts()):
        part.unregister()
