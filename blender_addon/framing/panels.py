"""The picture, its model and its boxes, in the sidebar of the 3D view."""

import textwrap

import bpy

from ..panel import PlayablePanel

LABEL_WIDTH = 34
"""Characters that the sidebar shows at its usual width."""


class PLAYABLE_PT_environment(PlayablePanel, bpy.types.Panel):
    """The picture and its model."""

    bl_label = "Environment"
    bl_idname = "PLAYABLE_PT_environment"

    def draw(self, context: bpy.types.Context) -> None:
        settings, layout = context.scene.playable_environment, self.layout
        layout.use_property_split = True
        layout.prop(settings, "model")
        _draw_facts(layout, settings)
        layout.operator("playable.load_model", icon="IMPORT")
        layout.prop(settings, "image_path")
        for each in settings.boxes:
            column = layout.column(align=True)
            column.label(text=each.name)
            for index, edge in enumerate(("Left", "Top", "Right", "Bottom")):
                column.prop(each, "box", index=index, text=edge)
        _draw_ways_in(layout)
        if settings.root is not None:
            layout.prop(settings, "root")


def _draw_facts(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    width, height = settings.native_size
    if not width:
        return
    column = layout.column(align=True)
    column.label(text=f"{width} x {height}, {settings.steps_per_second:g} steps a second")
    terms = textwrap.wrap(f"Weights: {settings.licence}", LABEL_WIDTH) if settings.licence else []
    for line in terms:
        column.label(text=line)


def _draw_ways_in(layout: bpy.types.UILayout) -> None:
    # Both say which camera: Blender would repeat the last choice for a button that does not.
    column = layout.column(align=True)
    own = column.operator("playable.new_environment", icon="OUTLINER_OB_EMPTY")
    own.camera = "SCENE"
    usual = column.operator(
        "playable.new_environment", text="New, from the Usual Camera", icon="CAMERA_DATA"
    )
    usual.camera = "USUAL"


CLASSES = (PLAYABLE_PT_environment,)


def register() -> None:
    """Register the panel."""
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister() -> None:
    """Undo `register`."""
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
