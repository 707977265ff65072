"""Boxes that can be encoded: inside of the picture and with an area."""

from collections.abc import Mapping

from pe_runtime.contract.errors import ShotError

Box = tuple[float, float, float, float]
"""Left, top, right, bottom in pixels of the picture."""
LEAST = 1.0
"""Pixels below which a side of a box is no side."""


def inside(name: str, box: Box, size: tuple[int, int]) -> tuple[Box, str]:
    """The part of a box that lies in the picture, and a note where that is not the whole box.

    Args:
        name: The playable object's, for the note.
        box: What was drawn, typed or tracked.
        size: Width and height of the picture.

    Raises:
        ShotError: Nothing of it lies in the picture, or it has no area.
    """
    left, top, right, bottom = map(float, box)
    if not (right - left >= LEAST and bottom - top >= LEAST):
        raise ShotError(
            f"the box of {name!r} has no area: left {left:g}, top {top:g}, right {right:g}, "
            f"bottom {bottom:g}; draw it again from corner to corner"
        )
    width, height = size
    part = max(left, 0.0), max(top, 0.0), min(right, float(width)), min(bottom, float(height))
    if part[2] - part[0] < LEAST or part[3] - part[1] < LEAST:
        raise ShotError(
            f"the box of {name!r} lies outside the picture of {width} x {height} pixels: left "
            f"{left:g}, top {top:g}, right {right:g}, bottom {bottom:g}; pixels count from the "
            "picture's upper left corner"
        )
    if part == (left, top, right, bottom):
        return part, ""
    return part, f"the box of {name} was cut at the picture's border"


def nearest_inside(u: float, v: float, size: tuple[int, int]) -> tuple[float, float]:
    """The place in a picture that is nearest to a place in or beside it, pixels."""
    return min(max(u, 0.0), float(size[0])), min(max(v, 0.0), float(size[1]))


def all_inside(boxes: Mapping[str, Box], size: tuple[int, int]) -> tuple[dict[str, Box], list[str]]:
    """`inside` for every box; the boxes and the notes."""
    found = {name: inside(name, box, size) for name, box in boxes.items()}
    boxes = {name: box for name, (box, _) in found.items()}
    return boxes, [note for _, note in found.values() if note]
