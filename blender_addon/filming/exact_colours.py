"""One click where the scene would save other colours than the model's."""

import bpy

from ..polls import allowed
from ..scene_bridge import ENGINE
from ..worker.worker_operator import Result
from .pixels import colour_changes, use_exact_colours

EXACT_SPACE = "Linear Rec.709"


class PLAYABLE_OT_use_exact_colours(bpy.types.Operator):
    """Set the scene's colour management so that the model's colours are saved as they are"""

    bl_idname = "playable.use_exact_colours"
    bl_label = "Use Exact Colours"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        changes = colour_changes(context.scene)
        return allowed(cls, bool(changes), "The colours are saved as the model draws them already")

    def execute(self, context: bpy.types.Context) -> Result:
        use_exact_colours(context.scene)
        remaining = all_colour_changes(context.scene)
        if remaining:
            self.report({"WARNING"}, "Still different: " + "; ".join(remaining))
        else:
            self.report({"INFO"}, "Colours are saved exactly as the model draws them")
        return {"FINISHED"}


def all_colour_changes(scene: bpy.types.Scene) -> list[str]:
    """`colour_changes` of a scene, and what the whole file does to its colours."""
    # Since 5.0 a file chooses the space in which it reckons; the model's pixels are Rec. 709.
    space = getattr(getattr(bpy.data, "colorspace", None), "working_space", EXACT_SPACE)
    changes = colour_changes(scene)
    if space != EXACT_SPACE:
        changes.append(
            f"the file's working space is {space!r} instead of {EXACT_SPACE!r} (Render properties, "
            "Color Management)"
        )
    return changes


def draw_colour_changes(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    """What would change the colours, and the button against it; nothing where all is well."""
    if not (changes := all_colour_changes(scene)):
        return
    column = layout.column(align=True)
    column.label(text="Colours differ from the model's", icon="ERROR")
    for change in changes:
        column.label(text=change, translate=False)
    column.operator(PLAYABLE_OT_use_exact_colours.bl_idname, icon="COLOR")


def _draw_in_colour_management(self: bpy.types.Panel, context: bpy.types.Context) -> None:
    if context.scene.render.engine == ENGINE:
        draw_colour_changes(self.layout, context.scene)


def register() -> None:
    """Register the operator and show it in Blender's own panel."""
    bpy.utils.register_class(PLAYABLE_OT_use_exact_colours)
    bpy.types.RENDER_PT_color_management.append(_draw_in_colour_management)


def unregister() -> None:
    """Undo `register`."""
    bpy.types.RENDER_PT_color_management.remove(_draw_in_colour_management)
    bpy.utils.unregister_class(PLAYABLE_OT_use_exact_colours)
