"""Playing on the timeline: action keys, and the paths that they lead to."""


def _parts() -> tuple:
    from . import claim_operators, clip_operators, key_operators, operators, panels, watching

    return operators, key_operators, claim_operators, clip_operators, panels, watching


def register() -> None:
    """Register the parts in order."""
    for part in _parts():
        part.register()


def unregister() -> None:
    """Undo `register`."""
    for part in reversed(_parts()):
        part.unregister()
