"""Playing on the timeline: action keys, and the paths that they lead to."""


def _parts() -> tuple:
    from . import operators, panels

    return (
        operators,
        panels,
    )


def register() -> None:
    """Register the parts in order."""
    for part in _parts():
        part.register()


def unregister() -> None:
    """Undo `register`."""
    for part in reversed(_parts()):
        part.unregister()
