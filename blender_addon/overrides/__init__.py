"""Overrides: what the artist has differently from the prediction, keyed frame by frame.

Places, styles, poses and visibility are read at every frame and applied when it is drawn, so that
nothing has to be baked again for them.
"""


def _parts() -> tuple:
    from . import export_operators, panels, place_operators, pose_operators, style_operators

    return (
        style_operators,
        pose_operators,
        place_operators,
        export_operators,
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
