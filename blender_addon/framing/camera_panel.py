"""Step 2 of the environment panel: which camera saw the picture."""

import bpy
from bpy.app.translations import pgettext_iface as iface_

from .backdrop import shown_size
from .cameras import has_shape, matched_camera
from .landmarks import GOOD_RESIDUAL


class PLAYABLE_UL_ground_points(bpy.types.UIList):
    """Points of the ground with their residuals."""

    def draw_item(
        self,
        _context: bpy.types.Context,
        layout: bpy.types.UILayout,
        _data: bpy.types.PropertyGroup,
        item: bpy.types.PropertyGroup,
        _icon: int,
        _active_data: bpy.types.PropertyGroup,
        _active_property: str,
    ) -> None:
        row = layout.row(align=True)
        row.prop(item, "name", text="", emboss=False, icon=_icon_of(item))
        row.label(text=_said_of(item))


def draw_camera(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    """Draw the step for a scene."""
    framing = scene.playable_environment.framing
    layout.row().prop(framing, "camera_mode", expand=True)
    if framing.camera_mode == "MATCH":
        _draw_match(layout, scene)
    elif framing.camera_mode == "USUAL":
        layout.label(text="The model's usual view", icon="INFO")
    else:
        layout.prop(framing, "camera")
        size = shown_size(scene)
        if size is not None and not has_shape(scene.render, size):
            layout.operator("playable.use_picture_size", icon="FULLSCREEN_ENTER")


def _draw_match(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    framing = scene.playable_environment.framing
    layout.operator("playable.place_ground_points", icon="CURSOR")
    row = layout.row()
    row.template_list(
        "PLAYABLE_UL_ground_points", "", framing, "points", framing, "active_point", rows=4
    )
    column = row.column(align=True)
    column.operator("playable.add_ground_point", text="", icon="ADD")
    column.operator("playable.remove_ground_point", text="", icon="REMOVE")
    if 0 <= framing.active_point < len(framing.points):
        point = framing.points[framing.active_point]
        column = layout.column(align=True)
        column.prop(point, "place", index=0, text="Ground X")
        column.prop(point, "place", index=1, text="Y")
        column.prop(point, "pixel", index=0, text="Pixel X")
        column.prop(point, "pixel", index=1, text="Y")
        layout.operator_menu_enum("playable.use_landmark", "landmark", icon="EMPTY_AXIS")
    layout.prop(framing, "is_lens_known")
    if framing.is_lens_known:
        layout.prop(framing, "field_of_view")
    layout.operator("playable.match_camera", icon="OUTLINER_OB_CAMERA")
    _draw_residual(layout, scene)


def _draw_residual(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    framing, size = scene.playable_environment.framing, shown_size(scene)
    if not framing.matched:
        return
    if size is not None and matched_camera(scene, size) is None:
        layout.label(text="Points have moved: match again", icon="FILE_REFRESH")
    elif framing.residual > GOOD_RESIDUAL:
        said = iface_("Residual {pixels} px: check points").format(pixels=_pixels(framing.residual))
        layout.label(text=said, icon="ERROR", translate=False)
    else:
        said = iface_("Residual {pixels} px").format(pixels=_pixels(framing.residual))
        layout.label(text=said, icon="CHECKMARK", translate=False)


def _pixels(number: float) -> str:
    return f"{number:.2f}"


def _icon_of(point: bpy.types.PropertyGroup) -> str:
    if not point.is_placed:
        return "RADIOBUT_OFF"
    return "ERROR" if point.miss > GOOD_RESIDUAL else "RADIOBUT_ON"


def _said_of(point: bpy.types.PropertyGroup) -> str:
    if not point.is_placed:
        return iface_("not placed")
    return f"{_pixels(point.miss)} px" if point.miss >= 0 else iface_("placed")


CLASSES = (PLAYABLE_UL_ground_points,)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
