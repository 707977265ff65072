"""Overrides: what the artist has differently from the prediction, keyed frame by frame.

Places, styles, poses and visibility are read at every frame and applied when it is drawn, so that
nothing has to be baked again for them.
"""

from ..registration import in_order


def _parts() -> tuple:
    from . import export_operators, panels, place_operators, pose_operators, style_operators

    return (
        style_operators,
        pose_operators,
        place_operators,
        export_operators,
        panels,
    )


register, unregister = in_order(_parts)
