"""Where the add-on's panels stand, and how they show texts of more than one line."""

from collections.abc import Sequence

import bpy
from bpy.app.translations import pgettext_iface as iface_

from .wrapping import SIDEBAR_CHARACTERS, wrapped

LINE_SCALE = 0.8
CHARACTER, MARGIN = 7.0, 60.0
"""Pixels of an average character, and of what stands beside texts, at the usual interface scale."""


class PlayablePanel:
    """A panel of the tab *Playable* in the sidebar of the 3D view."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Playable"


def characters_beside_icon(context: bpy.types.Context) -> int:
    """How many characters of a label fit beside an icon into the region as wide as it is."""
    scale = context.preferences.system.ui_scale
    return max(int((context.region.width / scale - MARGIN) / CHARACTER), 16)


def wrapped_label(
    layout: bpy.types.UILayout, text: str, icon: str = "NONE", characters: int = SIDEBAR_CHARACTERS
) -> None:
    """A label of several lines, in the artist's language; labels themselves end where panels do.

    Args:
        layout: Where it goes.
        text: What it says, in English.
        icon: Before its first line.
        characters: That fit into a line.
    """
    label_lines(layout, wrapped(iface_(text), characters), icon)


def label_lines(layout: bpy.types.UILayout, lines: Sequence[str], icon: str = "NONE") -> None:
    """Lines close together, the icon before the first one."""
    column = layout.column(align=True)
    column.scale_y = LINE_SCALE
    for number, line in enumerate(lines):
        column.label(text=line, icon=icon if not number or icon == "NONE" else "BLANK1")
