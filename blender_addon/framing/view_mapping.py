"""Between a 3D view that looks through a camera and the pixels of the picture that fills its frame.

Region pixels count from the lower left corner of the view, picture pixels from the upper left
corner of the picture.
"""

import math
from dataclasses import dataclass

import numpy as np

NARROWEST = 1.0
"""Region pixels below which a frame cannot be drawn on."""


@dataclass(frozen=True)
class PictureFrame:
    """Where a picture appears in a view.

    Attributes:
        left: Region pixels of the left edge.
        bottom: Region pixels of the lower edge.
        right: Region pixels of the right edge.
        top: Region pixels of the upper edge.
        width: Columns of the picture.
        height: Rows of the picture.
    """

    left: float
    bottom: float
    right: float
    top: float
    width: int
    height: int

    @property
    def zoom(self) -> float:
        """Region pixels per pixel of the picture."""
        return (self.right - self.left) / self.width

    def to_picture(self, x: float, y: float) -> tuple[float, float]:
        """The pixel of the picture under a place in the view; beyond the picture too."""
        u = (x - self.left) / (self.right - self.left) * self.width
        v = (self.top - y) / (self.top - self.bottom) * self.height
        return u, v


def frame_in_view(
    corners: np.ndarray,
    clip_from_world: np.ndarray,
    region_size: tuple[int, int],
    picture_size: tuple[int, int],
) -> PictureFrame | None:
    """Where a view that looks through a camera shows the camera's frame.

    Args:
        corners: (4, 3) corners of the camera's frame, world space.
        clip_from_world: (4, 4) projection of the view, as `RegionView3D.perspective_matrix`.
        region_size: Width and height of the view, region pixels.
        picture_size: Width and height of the picture that fills the frame.

    Returns:
        None where the frame is behind the view or too small to work on.
    """
    whole = np.column_stack([np.asarray(corners, np.float64), np.ones(len(corners))])
    clip = whole @ np.asarray(clip_from_world, np.float64).T
    if not (clip[:, 3] > 0).all():
        return None
    spots = (clip[:, :2] / clip[:, 3:] + 1) / 2 * region_size
    (left, bottom), (right, top) = spots.min(axis=0), spots.max(axis=0)
    if not min(right - left, top - bottom) >= NARROWEST:
        return None
    return PictureFrame(float(left), float(bottom), float(right), float(top), *picture_size)


def fitted_between(zoom: float, width: int, left: int, right: int) -> tuple[float, float]:
    """Zoom and sideways offset of a camera's view, so that sidebars hide nothing of its frame.

    Args:
        zoom: The view's `view_camera_zoom` with which the frame fits into all of its width.
        width: Of the view, region pixels.
        left: Region pixels that are hidden on the left.
        right: Region pixels that are hidden on the right.

    Returns:
        `view_camera_zoom` and the first number of `view_camera_offset`.
    """
    # Blender's own scale of the camera's view: 1/2 at no zoom.
    scale = (math.sqrt(2) + zoom / 50) ** 2 / 4
    scale *= max(width - left - right, width / 4) / width
    offset = (right - left) / 2 / (2 * width * scale)
    return 50 * (2 * math.sqrt(scale) - math.sqrt(2)), offset
