"""Living in a file: what older versions saved is brought up to date, what is missing is said."""


def _parts() -> tuple:
    from . import file_events, panels

    return file_events, panels


def register() -> None:
    """Register the parts in order."""
    for part in _parts():
        part.register()


def unregister() -> None:
    """Undo `register`."""
    for part in reversed(_parts()):
        part.unregister()
