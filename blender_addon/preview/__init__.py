"""The picture in viewports with Rendered shading."""


def register() -> None:
    """Nothing yet: the timer starts with the first viewport that draws."""


def unregister() -> None:
    """Stop the timer and the drawing."""
    from . import ticking

    ticking.unregister()
