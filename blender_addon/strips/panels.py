"""What is rendered and where its strip goes; and beside a strip, where it comes from."""

import bpy

from ..filming.exact_colours import draw_colour_changes
from ..panel import PlayablePanel, characters_beside_icon, wrapped_label
from .provenance import read_provenance, scene_of_strip
from .running import shown_progress
from .strip_operators import active_strip
from .target import shadowed, target_warnings


class PLAYABLE_PT_output(PlayablePanel, bpy.types.Panel):
    """Rendered frames and their strip."""

    bl_label = "Output"
    bl_idname = "PLAYABLE_PT_output"
    bl_order = 5

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        # Before there is an environment, the three steps to it are all there is to see.
        return context.scene.playable_environment.root is not None

    def draw(self, context: bpy.types.Context) -> None:
        scene, layout = context.scene, self.layout
        settings = scene.playable_environment
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.prop(settings, "quality")
        _draw_passes(layout, context)
        layout.prop(settings, "frames_folder")
        layout.prop(settings.strips, "only_changed")
        _draw_buttons(layout, settings)
        _draw_warnings(layout, scene, characters_beside_icon(context))


class PLAYABLE_PT_strip_target(PlayablePanel, bpy.types.Panel):
    """Where the strip of the rendered frames goes."""

    bl_label = "Strip"
    bl_idname = "PLAYABLE_PT_strip_target"
    bl_parent_id = "PLAYABLE_PT_output"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        settings, layout = context.scene.playable_environment, self.layout
        strips = settings.strips
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.prop(strips, "target")
        target = strips.target or settings.edit_scene
        if strips.target is not None and strips.target.playable_environment.root is not None:
            layout.prop(strips, "share_scene")
        elif target is not None:
            layout.label(text=f"In {target.name}", icon="SCENE_DATA", translate=False)
        layout.prop(strips, "channel")
        layout.prop(strips, "frame_offset")
        for warning in target_warnings(context.scene, target) if target is not None else ():
            wrapped_label(layout, warning, "ERROR", characters_beside_icon(context))


class PLAYABLE_PT_strip(bpy.types.Panel):
    """Where the active strip comes from, and its frames again."""

    bl_label = "Playable Environment"
    bl_idname = "PLAYABLE_PT_strip"
    bl_space_type = "SEQUENCE_EDITOR"
    bl_region_type = "UI"
    bl_category = "Strip"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return active_strip(context) is not None

    def draw(self, context: bpy.types.Context) -> None:
        strip, layout = active_strip(context), self.layout
        source = scene_of_strip(strip)
        column = layout.column(align=True)
        column.operator("playable.render_again", icon="RENDER_ANIMATION")
        column.operator("playable.open_frames_folder", icon="FILE_FOLDER")
        column.operator("playable.select_environment", icon="OUTLINER_OB_EMPTY")
        if source is not None:
            _draw_progress(layout, source.playable_environment.job)
        _draw_provenance(layout, read_provenance(strip), source)


def _draw_passes(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    column = layout.column(heading="Passes")
    column.prop(context.view_layer, "use_pass_z", text="Depth")
    column.prop(context.scene.playable_environment, "use_background")
    for each in context.scene.objects:
        if each.playable.is_playable:
            row = layout.row(align=True, heading=each.name, translate=False)
            row.prop(each.playable, "use_mask", toggle=True)
            row.prop(each.playable, "use_layer", toggle=True)


def _draw_buttons(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    if _draw_progress(layout, settings.job):
        return
    column = layout.column(align=True)
    column.operator("playable.render_to_sequencer", icon="SEQ_SEQUENCER")
    again = column.operator(
        "playable.render_to_sequencer", text="Render Everything Again", icon="FILE_REFRESH"
    )
    again.everything = True


def _draw_progress(layout: bpy.types.UILayout, job: str) -> bool:
    """Show how far a job is; whether it is under way."""
    progress = shown_progress.get(job)
    if progress is not None:
        layout.progress(text=progress.text, factor=progress.share)
        layout.label(text="Esc to stop; finished frames are kept")
    return progress is not None


def _draw_warnings(layout: bpy.types.UILayout, scene: bpy.types.Scene, width: int) -> None:
    if reason := shadowed(scene):
        wrapped_label(layout, reason, "ERROR", width)
        layout.operator("playable.leave_sequencer_out")
    draw_colour_changes(layout, scene)


def _draw_provenance(
    layout: bpy.types.UILayout, found: dict[str, str], source: bpy.types.Scene | None
) -> None:
    column = layout.column(align=True)
    column.use_property_split = True
    lines = (
        ("Scene", source.name if source is not None else found.get("scene", "")),
        ("Model", f"{found.get('model', '')} {found.get('model_digest', '')[:8]}"),
        ("State", found.get("state", "")[:8]),
        ("Shot", found.get("shot", "")[:8]),
        ("Camera", found.get("camera", "")),
        ("Quality", found.get("quality", "").capitalize()),
        ("Version", found.get("version", "")),
        ("Rendered", _moment(found.get("rendered", ""))),
    )
    for label, value in lines:
        split = column.split(factor=0.35)
        split.label(text=label)
        split.label(text=value, translate=False)


def _moment(iso: str) -> str:
    """A time of ISO 8601 in UTC, as people read it."""
    return f"{iso[:10]} {iso[11:16]} UTC" if iso else ""


CLASSES = (PLAYABLE_PT_output, PLAYABLE_PT_strip_target, PLAYABLE_PT_strip)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
