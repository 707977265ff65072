"""What the playable objects do, and where it leads them."""

import bpy

from pe_runtime.contract.errors import ShotError

from ..bake import bake_of
from ..panel import PlayablePanel
from ..scene_bridge import action_names


class PLAYABLE_PT_object(PlayablePanel, bpy.types.Panel):
    """What the active playable object does."""

    bl_label = "Playable Object"
    bl_idname = "PLAYABLE_PT_object"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None and context.object.type == "EMPTY"

    def draw(self, context: bpy.types.Context) -> None:
        playable, layout = context.object.playable, self.layout
        layout.use_property_split = True
        layout.prop(playable, "is_playable")
        if not playable.is_playable:
            return
        layout.prop(playable, "object_name")
        if not action_names(context.object):
            layout.label(text="The model has no actions for it", icon="INFO")
            return
        layout.prop(playable, "action")
        layout.operator_menu_enum("playable.insert_action_key", "action", icon="KEY_HLT")


class PLAYABLE_PT_paths(PlayablePanel, bpy.types.Panel):
    """Predicted paths."""

    bl_label = "Paths"
    bl_idname = "PLAYABLE_PT_paths"

    def draw(self, context: bpy.types.Context) -> None:
        scene, layout = context.scene, self.layout
        row = layout.row(align=True)
        row.prop(scene, "frame_start", text="Start")
        row.prop(scene, "frame_end", text="End")
        layout.operator("playable.bake_paths", icon="CURVE_PATH")
        try:
            shot = bake_of(scene.playable_environment).shot
            layout.label(text=f"Baked: frames {shot.frame_start} to {shot.frame_end}")
        except ShotError as reason:
            layout.label(text=str(reason).partition(";")[0].capitalize(), icon="INFO")


CLASSES = (PLAYABLE_PT_object, PLAYABLE_PT_paths)


def register() -> None:
    """Register the panels."""
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister() -> None:
    """Undo `register`."""
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
