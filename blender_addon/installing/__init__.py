"""The runtime: where it lives, whether it works, how it gets there."""


def _parts() -> tuple:
    from . import operators, panels, preferences

    return (
        preferences,
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
