"""What is rendered, and where its strip goes."""

import bpy

from ..panel import PlayablePanel


class PLAYABLE_PT_output(PlayablePanel, bpy.types.Panel):
    """Rendered frames and their strip."""

    bl_label = "Output"
    bl_idname = "PLAYABLE_PT_output"

    def draw(self, context: bpy.types.Context) -> None:
        settings, layout = context.scene.playable_environment, self.layout
        layout.use_property_split = True
        layout.prop(settings, "quality")
        column = layout.column(heading="Passes")
        column.prop(context.view_layer, "use_pass_z", text="Depth")
        for each in context.scene.objects:
            if each.playable.is_playable:
                column.prop(each.playable, "use_mask", text=f"Mask of {each.name}")
        layout.prop(settings, "frames_folder")
        layout.operator("playable.render_to_sequencer", icon="SEQ_SEQUENCER")
        if settings.edit_scene is not None:
            layout.label(text=f"Strip in scene {settings.edit_scene.name!r}", icon="SCENE_DATA")


CLASSES = (PLAYABLE_PT_output,)


def register() -> None:
    """Register the panel."""
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister() -> None:
    """Undo `register`."""
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
