"""The overlay's switches, and the overlay itself where there is a window."""

import bpy

from ..panel import PlayablePanel
from . import viewport

BEFORE_ENCODING = ("grid", "boxes", "volumes", "points")
AFTER_ENCODING = ("players", "paths", "steps", "actions", "headings")


class PLAYABLE_PT_overlay(PlayablePanel, bpy.types.Panel):
    """What is drawn over the scene in 3D viewports."""

    bl_label = "Overlay"
    bl_translation_context = "Playable"
    bl_idname = "PLAYABLE_PT_overlay"
    bl_order = 4
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.scene.playable_environment.overlay, "show", text="")

    def draw(self, context: bpy.types.Context) -> None:
        overlay, layout = context.scene.playable_environment.overlay, self.layout
        layout.active = overlay.show
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column(heading="Picture", align=True)
        for name in BEFORE_ENCODING:
            column.prop(overlay, name)
        column = layout.column(heading="Playing", align=True)
        for name in AFTER_ENCODING:
            column.prop(overlay, name)
        column.prop(overlay, "ghosts")
        column = layout.column(align=True)
        column.active = overlay.ghosts
        column.prop(overlay, "ghosts_before")
        column.prop(overlay, "ghosts_after")
        column.prop(overlay, "ghost_steps")


def _draw_view() -> None:
    viewport.draw_view(bpy.context)


def _draw_pixels() -> None:
    viewport.draw_pixels(bpy.context)


CLASSES = (PLAYABLE_PT_overlay,)


def register() -> None:
    """Register the panel and, where there is a window, draw in its viewports."""
    for each in CLASSES:
        bpy.utils.register_class(each)
    if not bpy.app.background:
        # While an add-on is enabled there is no context yet: each redraw asks for its own.
        viewport.start(_draw_view, _draw_pixels)


def unregister() -> None:
    """Undo `register`."""
    viewport.stop()
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
