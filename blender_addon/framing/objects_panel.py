"""Step 3 of the environment panel: where the picture shows the playable objects."""

import bpy

EDGES = ("Left", "Top", "Right", "Bottom")


def draw_objects(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    """Draw the step for a scene."""
    settings = scene.playable_environment
    row = layout.row(align=True)
    row.operator("playable.detect_boxes", icon="VIEWZOOM")
    row.operator("playable.draw_boxes", icon="GREASEPENCIL")
    for each in settings.boxes:
        _draw_box(layout, each)
    header, body = layout.panel("PLAYABLE_tracks", default_closed=True)
    header.label(text="From Tracking Markers")
    if body is not None:
        _draw_tracks(body, settings.framing)


def draw_edges(column: bpy.types.UILayout, owner: bpy.types.PropertyGroup) -> None:
    """Fields for the four numbers of a `box`."""
    for index, edge in enumerate(EDGES):
        column.prop(owner, "box", index=index, text=edge)


def _draw_box(layout: bpy.types.UILayout, each: bpy.types.PropertyGroup) -> None:
    there = any(each.box)
    header, body = layout.panel_prop(each, "is_shown")
    header.label(text=each.name, icon="CHECKMARK" if there else "RADIOBUT_OFF")
    header.operator("playable.draw_boxes", text="", icon="GREASEPENCIL").object = each.name
    if body is not None:
        draw_edges(body.column(align=True), each)


def _draw_tracks(layout: bpy.types.UILayout, framing: bpy.types.PropertyGroup) -> None:
    layout.template_ID(framing, "clip", open="clip.open")
    for each in framing.tracked if framing.clip is not None else ():
        # How several names begin is no name of its own.
        layout.prop_search(
            each,
            "tracks",
            framing.clip.tracking,
            "tracks",
            text=each.name,
            results_are_suggestions=True,
        )
    layout.operator("playable.boxes_from_tracks", icon="TRACKER")
