"""The parts of Blender's windows that have to be drawn again. Main thread only."""

from collections.abc import Iterator

import bpy


def areas(*kinds: str) -> Iterator[bpy.types.Area]:
    """The areas of all windows that show editors of these kinds."""
    for manager in bpy.data.window_managers:
        for window in manager.windows:
            yield from (each for each in window.screen.areas if each.type in kinds)


def redraw(*kinds: str) -> None:
    """Have all editors of these kinds drawn again."""
    for each in areas(*kinds):
        each.tag_redraw()


def redraw_sidebars(*kinds: str) -> None:
    """Have their sidebars drawn again, but not the costly views beside those."""
    for each in areas(*kinds):
        for region in (one for one in each.regions if one.type == "UI"):
            region.tag_redraw()
