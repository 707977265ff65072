"""The part of a frame inside Blender's render border, in whole pixels. No `bpy` here."""

from dataclasses import dataclass

import numpy as np

from pe_runtime.contract.shot import Region


@dataclass(frozen=True)
class Border:
    """A render border as Blender keeps it: shares of the frame, 0 to 1, from its lower left."""

    min_x: float
    max_x: float
    min_y: float
    max_y: float

    def region(self, width: int, height: int) -> Region:
        """The pixels that Blender renders of a frame: left, top, width, height.

        They are empty where the border is narrower than a pixel; Blender refuses such a render
        before it asks anybody.
        """
        left, right = _whole_pixels(self.min_x, width), _whole_pixels(self.max_x, width)
        bottom, top = _whole_pixels(self.min_y, height), _whole_pixels(self.max_y, height)
        return left, height - top, right - left, top - bottom


def border_of(render: object) -> Border | None:
    """The border of some render settings; None where the whole frame is rendered."""
    if not render.use_border:
        return None
    return Border(
        render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y
    )


def _whole_pixels(share: float, size: int) -> int:
    # Blender multiplies in single precision, which is another pixel now and then.
    return int(np.float32(share) * np.float32(size))
