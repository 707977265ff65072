"""What the active object has differently from the prediction, and the looks there are to choose."""

import bpy

from ..framing.objects_panel import draw_edges
from ..panel import PlayablePanel
from .settings import OverrideSettings, StyleSource


class PLAYABLE_UL_styles(bpy.types.UIList):
    """The collected styles: a name that can be changed, and whose look it is."""

    def draw_item(
        self,
        _context: bpy.types.Context,
        layout: bpy.types.UILayout,
        _data: object,
        item: StyleSource,
        _icon: int,
        _active_data: object,
    ) -> None:
        row = layout.row(align=True)
        row.prop(item, "name", text="", emboss=False, icon="MATERIAL")
        row.label(text=item.object_name, translate=False)


class PLAYABLE_PT_overrides(PlayablePanel, bpy.types.Panel):
    """What the active object has differently from the prediction; every field can be keyed."""

    bl_label = "Overrides"
    bl_idname = "PLAYABLE_PT_overrides"
    bl_parent_id = "PLAYABLE_PT_object"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None and context.object.playable.is_playable

    def draw(self, context: bpy.types.Context) -> None:
        target, layout = context.object, self.layout
        own = target.playable.overrides
        layout.use_property_split = True
        _draw_place(layout, own)
        _draw_style(layout, own)
        _draw_pose(layout, own)
        layout.prop(
            target, "hide_render", text="Show in Renders", toggle=False, invert_checkbox=True
        )


class PLAYABLE_PT_styles(PlayablePanel, bpy.types.Panel):
    """The looks from other pictures that the scene's players can take on."""

    bl_label = "Styles"
    bl_idname = "PLAYABLE_PT_styles"
    bl_order = 3
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        # Before there is an environment, the three steps to it are all there is to see.
        return context.scene.playable_environment.root is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout, styles = self.layout, context.scene.playable_environment.styles
        if styles.sources:
            row = layout.row()
            row.template_list("PLAYABLE_UL_styles", "", styles, "sources", styles, "active", rows=2)
            row.operator("playable.remove_style", text="", icon="REMOVE")
        layout.use_property_split = True
        column = layout.column(align=True)
        for name in ("image_path", "player", "camera"):
            column.prop(styles, name)
        draw_edges(column, styles)
        column.operator("playable.add_style", icon="ADD")
        row = layout.row(align=True)
        row.prop(styles, "scene")
        row.operator("playable.add_scene_styles", text="", icon="ADD")


class PLAYABLE_PT_shot_file(PlayablePanel, bpy.types.Panel):
    """The film as a file for the command line."""

    bl_label = "Shot File"
    bl_idname = "PLAYABLE_PT_shot_file"
    bl_parent_id = "PLAYABLE_PT_output"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, _context: bpy.types.Context) -> None:
        self.layout.operator("playable.export_shot", icon="EXPORT")


def _draw_place(layout: bpy.types.UILayout, own: OverrideSettings) -> None:
    column = layout.column(align=True)
    column.prop(own, "place")
    row = column.row(align=True)
    row.operator("playable.leave_path", icon="UNLINKED")
    row.operator_menu_enum("playable.follow_path", "extent", text="Follow Again", icon="LINKED")


def _draw_style(layout: bpy.types.UILayout, own: OverrideSettings) -> None:
    column = layout.column(align=True)
    column.prop(own, "style")
    if own.style == "OBJECT":
        column.prop(own, "style_object")
    elif own.style == "PICTURE":
        column.prop(own, "style_source")
    if own.style != "OWN":
        column.prop(own, "style_mix")


def _draw_pose(layout: bpy.types.UILayout, own: OverrideSettings) -> None:
    column = layout.column(align=True)
    column.prop(own, "pose")
    if own.pose == "HELD":
        freed = column.operator("playable.hold_pose", text="Free Pose", icon="UNLOCKED")
        freed.hold = False
    else:
        column.operator("playable.hold_pose", icon="LOCKED").hold = True


CLASSES = (PLAYABLE_UL_styles, PLAYABLE_PT_overrides, PLAYABLE_PT_styles, PLAYABLE_PT_shot_file)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
