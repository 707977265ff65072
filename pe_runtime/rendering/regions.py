"""Rectangles of a map's cells: which part of a picture has to be decoded again."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool
from scipy import ndimage
from torch import Tensor

GRID = 4
"""Edges of work lie on multiples of this many cells, so that the same shapes come again (a backend
tunes itself for every shape that it meets), and so that pixels which are computed together stay
together (see `PackedConvolution.together`)."""
MOST = 6
"""Rectangles around changed cells, at most."""


@dataclass(frozen=True, order=True)
class Region:
    """Rows from `top` to before `bottom` and columns from `left` to before `right` of a map."""

    top: int
    left: int
    bottom: int
    right: int

    @classmethod
    def from_sizes(cls, left: int, top: int, width: int, height: int) -> "Region":
        """The region with its upper left cell there."""
        return cls(top, left, top + height, left + width)

    @property
    def height(self) -> int:
        """Rows."""
        return self.bottom - self.top

    @property
    def width(self) -> int:
        """Columns."""
        return self.right - self.left

    @property
    def area(self) -> int:
        """Cells."""
        return self.height * self.width

    def grown(self, radius: int, within: "Region") -> "Region":
        """The region with a margin of `radius` cells, as far as the map goes."""
        return Region(
            max(within.top, self.top - radius),
            max(within.left, self.left - radius),
            min(within.bottom, self.bottom + radius),
            min(within.right, self.right + radius),
        )

    def doubled(self) -> "Region":
        """The same place in a map with cells of half the size."""
        return Region(2 * self.top, 2 * self.left, 2 * self.bottom, 2 * self.right)

    def joined(self, other: "Region") -> "Region":
        """The smallest region that covers both."""
        return Region(
            min(self.top, other.top),
            min(self.left, other.left),
            max(self.bottom, other.bottom),
            max(self.right, other.right),
        )

    def aligned(self, within: "Region") -> "Region":
        """The region with its edges moved outwards to the grid, as far as the map goes."""
        return Region(
            self.top // GRID * GRID,
            self.left // GRID * GRID,
            min(within.bottom, -(-self.bottom // GRID) * GRID),
            min(within.right, -(-self.right // GRID) * GRID),
        )


def changed_regions(changed: Bool[Tensor, "height width"]) -> list[Region]:
    """Rectangles around all changed cells; few, as cells that are near share one."""
    cells = changed.cpu().numpy()
    if not cells.any():
        return []
    reach, found = 5, []
    while not found or len(found) > MOST:
        near = ndimage.maximum_filter(cells, size=reach)
        labels, _ = ndimage.label(near, structure=np.ones((3, 3)))
        found = ndimage.find_objects(np.where(cells, labels, 0))
        reach = 2 * reach + 1
    return merged([Region(y.start, x.start, y.stop, x.stop) for y, x in found])


def merged(regions: Sequence[Region], call: int = 0) -> list[Region]:
    """The regions with those in one that cost less together than apart.

    Args:
        regions: Any, also overlapping ones.
        call: What one more region costs, as the number of cells that take as long.
    """
    left, kept = sorted(set(regions)), []
    while left:
        each = left.pop()
        partner = next((o for o in left if _cheaper_together(each, o, call)), None)
        if partner is None:
            kept.append(each)
            continue
        left.remove(partner)
        # What joins may now reach regions that stood alone before.
        left, kept = [*kept, *left, each.joined(partner)], []
    return sorted(kept)


def _cheaper_together(one: Region, other: Region, call: int) -> bool:
    return one.joined(other).area <= one.area + other.area + call
