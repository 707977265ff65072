"""What is drawn over a scene in 3D viewports: the picture's marks, the players' paths."""

from ..registration import in_order


def _parts() -> tuple:
    from . import panels

    return (panels,)


register, unregister = in_order(_parts)
