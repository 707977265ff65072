"""From a picture to a scene: camera, boxes, and the Empties that stand for its objects."""


def _parts() -> tuple:
    from . import (
        box_operators,
        camera_operators,
        camera_panel,
        operators,
        panels,
        picture_tools,
    )

    return (
        operators,
        camera_operators,
        box_operators,
        picture_tools,
        camera_panel,
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
