"""The sidebar tab of the 3D view: from the picture, through the keys, to the strip."""

import textwrap

import bpy

from pe_runtime.contract.errors import ShotError

from .bake import bake_of
from .scene_bridge import action_names
from .session import session

LABEL_WIDTH = 34
"""Characters that the sidebar shows at its usual width."""


class PlayablePanel:
    """Where the panels stand."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Playable"


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
        _draw_worker(layout)


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


def _draw_worker(layout: bpy.types.UILayout) -> None:
    row = layout.row(align=True)
    row.label(text=f"Worker: {session.status}", icon="ERROR" if session.error else "CONSOLE")
    row.operator("playable.stop_worker", text="", icon="CANCEL")
    if session.error:
        layout.label(text=session.error.splitlines()[0])


CLASSES = (
    PLAYABLE_PT_environment,
    PLAYABLE_PT_object,
    PLAYABLE_PT_paths,
    PLAYABLE_PT_output,
)


def register() -> None:
    """Register the panels."""
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister() -> None:
    """Undo `register`."""
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
