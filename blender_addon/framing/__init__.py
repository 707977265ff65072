"""From a picture to a scene: camera, boxes, and the Empties that stand for its objects."""

from ..registration import in_order


def _parts() -> tuple:
    from . import box_operators, camera_operators, camera_panel, operators, panels, picture_tools

    return (
        operators,
        camera_operators,
        box_operators,
        picture_tools,
        camera_panel,
        panels,
    )


register, unregister = in_order(_parts)
