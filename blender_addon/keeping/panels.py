"""What a file lacks, shown above all else while it lacks it."""

import bpy
from bpy.app.translations import pgettext_iface as iface_

from ..panel import PlayablePanel, characters_beside_icon, wrapped_label
from ..wrapping import sentence
from .problems import problems_of


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
        width = characters_beside_icon(context)
        for problem in problems_of(context.scene):
            wrapped_label(self.layout, sentence(iface_(problem)), "ERROR", width)


def register() -> None:
    """Register the panel."""
    bpy.utils.register_class(PLAYABLE_PT_problems)


def unregister() -> None:
    """Undo `register`."""
    bpy.utils.unregister_class(PLAYABLE_PT_problems)
