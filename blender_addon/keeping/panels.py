"""What a file lacks, shown above all else while it lacks it."""

import textwrap

import bpy
from bpy.app.translations import pgettext_iface as iface_

from ..panel import PlayablePanel
from .problems import problems_of

LABEL_WIDTH = 40
"""Characters that the sidebar shows at its usual width."""


class PLAYABLE_PT_problems(PlayablePanel, bpy.types.Panel):
    """What is missing in this file."""

    bl_label = "Needs Attention"
    bl_idname = "PLAYABLE_PT_problems"
    # A panel without a header stands above all others, wherever the artist has put those.
    bl_options = {"HIDE_HEADER"}
    bl_order = -1

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(problems_of(context.scene))

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.label(text=self.bl_label)
        for problem in problems_of(context.scene):
            column = self.layout.column(align=True)
            icon = "ERROR"
            said = iface_(problem)
            for line in textwrap.wrap(said[:1].upper() + said[1:], LABEL_WIDTH):
                column.label(text=line, icon=icon)
                icon = "BLANK1"


def register() -> None:
    """Register the panel."""
    bpy.utils.register_class(PLAYABLE_PT_problems)


def unregister() -> None:
    """Undo `register`."""
    bpy.utils.unregister_class(PLAYABLE_PT_problems)
