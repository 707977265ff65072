"""From a picture to an environment in three steps, in the sidebar of the 3D view."""

from collections.abc import Sequence

import bpy
from bpy.app.translations import pgettext_iface as iface_

from pe_runtime.contract.errors import PlayableEnvironmentError

from ..panel import PlayablePanel, characters_beside_icon, wrapped_label
from .camera_panel import draw_camera
from .framed import FramedPicture, framed_picture
from .objects_panel import draw_objects
from .readiness import CAMERA, OBJECTS, PICTURE, all_missing, edits_of
from .settings import MODEL_FILE
from .strip_frames import frame_under_playhead

THUMBNAIL = 6.0


class PLAYABLE_PT_environment(PlayablePanel, bpy.types.Panel):
    """The picture, its camera and its objects."""

    bl_label = "Environment"
    bl_idname = "PLAYABLE_PT_environment"
    bl_order = 0

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split, layout.use_property_decorate = True, False
        edits = edits_of(context)
        lacks = {each.step: each.text for each in all_missing(context.scene, edits)}
        seen = framed_picture(context.scene)
        width, done = characters_beside_icon(context), _is_encoded(context.scene)
        if (body := _step(layout, "1   Picture", lacks.get(PICTURE, ""), width, done)) is not None:
            _draw_picture(body, context.scene, edits, width)
        trouble = lacks.get(CAMERA) or (seen.trouble if seen else "")
        if (body := _step(layout, "2   Camera", trouble, width, done)) is not None:
            draw_camera(body, context.scene)
        if (body := _step(layout, "3   Objects", lacks.get(OBJECTS, ""), width, done)) is not None:
            draw_objects(body, context.scene)
        _draw_warnings(layout, seen, width)
        _draw_ways_in(layout, done)
        if context.scene.playable_environment.root is not None:
            layout.prop(context.scene.playable_environment, "root")


def _step(
    layout: bpy.types.UILayout, title: str, lack: str, width: int, done: bool
) -> bpy.types.UILayout | None:
    """A numbered step that can be folded: ticked, or with what it still needs."""
    # Blender remembers by name what is folded: once encoded, the steps make room for playing.
    name = f"PLAYABLE_done_{title[0]}" if done else f"PLAYABLE_step_{title[0]}"
    header, body = layout.panel(name, default_closed=done)
    header.label(text=title, icon="RADIOBUT_OFF" if lack else "CHECKMARK")
    if body is not None and lack:
        wrapped_label(body, lack, "INFO", width)
    return body


def _draw_picture(
    layout: bpy.types.UILayout,
    scene: bpy.types.Scene,
    edits: Sequence[bpy.types.Scene],
    width: int,
) -> None:
    settings = scene.playable_environment
    framing = settings.framing
    layout.prop(framing, "model_choice")
    if framing.model_choice == MODEL_FILE:
        layout.prop(settings, "model", text="File")
    _draw_facts(layout, settings, width)
    row = layout.row()
    # Three words need the whole width.
    row.use_property_split = False
    row.prop(framing, "picture_source", expand=True)
    if framing.picture_source == "FILE":
        layout.prop(settings, "image_path", text="File")
    elif framing.picture_source == "IMAGE":
        layout.template_ID(framing, "image", open="image.open")
    else:
        _draw_strip(layout, edits)
    shown = framing.image if framing.picture_source == "IMAGE" else framing.backdrop
    if shown is not None and shown.preview is not None:
        layout.template_icon(shown.preview.icon_id, scale=THUMBNAIL)
    layout.operator("playable.show_picture", icon="HIDE_OFF")


def _draw_facts(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup, width: int) -> None:
    columns, rows = settings.native_size
    if not columns:
        layout.operator("playable.load_model", icon="IMPORT")
        return
    column = layout.column(align=True)
    steps = f"{settings.steps_per_second:g}"
    said = iface_("{size}, {steps} steps a second").format(size=f"{columns} x {rows}", steps=steps)
    column.label(text=said, translate=False)
    if settings.licence:
        terms = iface_("Weights: {licence}").format(licence=settings.licence)
        wrapped_label(column, terms, "NONE", width)


def _draw_strip(layout: bpy.types.UILayout, edits: Sequence[bpy.types.Scene]) -> None:
    try:
        shown = frame_under_playhead(edits)
    except PlayableEnvironmentError:
        return
    said = iface_("{strip}, frame {frame}").format(strip=shown.strip.name, frame=shown.frame)
    layout.label(text=said, icon="SEQUENCE", translate=False)


def _draw_warnings(layout: bpy.types.UILayout, seen: FramedPicture | None, width: int) -> None:
    if seen is None:
        return
    texts = [each.text for own in seen.warnings.values() for each in own]
    if texts:
        column = layout.column(align=True)
        column.label(text="Good to know before encoding:", icon="ERROR")
        for text in texts:
            wrapped_label(column, text, "DOT", width)


def _is_encoded(scene: bpy.types.Scene) -> bool:
    settings = scene.playable_environment
    return settings.root is not None and not settings.framing.is_open


def _draw_ways_in(layout: bpy.types.UILayout, done: bool) -> None:
    column = layout.column(align=True)
    column.scale_y = 1.0 if done else 1.6
    column.operator("playable.open_picture", icon="OUTLINER_OB_EMPTY")
    other = layout.operator("playable.open_picture", text="New in New Scene", icon="SCENE_DATA")
    other.new_scene = True


CLASSES = (PLAYABLE_PT_environment,)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
