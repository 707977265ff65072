"""What is drawn over a scene in 3D viewports: the picture's marks, the players' paths."""


def _parts() -> tuple:
    from . import panels

    return (panels,)


def register() -> None:
    """Register the parts in order."""
    for part in _parts():
        part.register()


def unregister() -> None:
    """Undo `register`."""
    for part in reversed(_parts()):
        part.unregister()
