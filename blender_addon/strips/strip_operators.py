"""What can be done from a strip: its frames again, its folder, its environment."""

from pathlib import Path

import bpy

from pe_runtime.contract.errors import ShotError

from ..polls import allowed
from ..worker.worker_operator import Result
from .job import RangeJob
from .operators import show_in_sequencer
from .provenance import JOB_KEY, scene_of_strip
from .range_operator import RangeOperator
from .running import Outcome


def active_strip(context: bpy.types.Context) -> bpy.types.Strip | None:
    """The strip that a sequencer editor shows as active, if it is one of this add-on's."""
    # Since 5.0 a sequencer editor need not show the window's scene.
    scene = getattr(context, "sequencer_scene", None) or context.scene
    editor = scene.sequence_editor
    strip = editor.active_strip if editor is not None else None
    return strip if strip is not None and JOB_KEY in strip else None


class StripOperator:
    """Works on the active strip, if that was rendered from an environment."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(
            cls,
            active_strip(context) is not None,
            "Select a strip that was rendered from a playable environment",
        )


class SourceOperator(StripOperator):
    """Works on the scene that the active strip was rendered from."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not super().poll(context):
            return False
        found = scene_of_strip(active_strip(context)) is not None
        return allowed(cls, found, "The scene that the strip was rendered from is not in this file")


class PLAYABLE_OT_render_again(SourceOperator, RangeOperator, bpy.types.Operator):
    """Render the frames of this strip that have changed, from the scene that they came from"""

    bl_idname = "playable.render_again"
    bl_label = "Render Again"
    bl_options = {"UNDO"}

    def source(self, context: bpy.types.Context) -> bpy.types.Scene:
        strip = active_strip(context)
        scene = scene_of_strip(strip) if strip is not None else None
        if scene is None:
            raise ShotError("the scene that the strip was rendered from is not in this file")
        return scene

    def frames_folder(self, context: bpy.types.Context) -> str:
        return active_strip(context).directory

    def conclude(self, context: bpy.types.Context, job: RangeJob, outcome: Outcome) -> None:
        show_in_sequencer(self, context, job, outcome)


class PLAYABLE_OT_open_frames_folder(StripOperator, bpy.types.Operator):
    """Show the strip's pictures in the system's file browser"""

    bl_idname = "playable.open_frames_folder"
    bl_label = "Open Frames Folder"

    def execute(self, context: bpy.types.Context) -> Result:
        folder = Path(bpy.path.abspath(active_strip(context).directory))
        if not folder.is_dir():
            self.report({"ERROR"}, f"the frames folder {folder} does not exist any more")
            return {"CANCELLED"}
        return bpy.ops.wm.path_open(filepath=str(folder))


class PLAYABLE_OT_select_environment(SourceOperator, bpy.types.Operator):
    """Go to the scene that the strip was rendered from and select its environment"""

    bl_idname = "playable.select_environment"
    bl_label = "Select Environment"
    bl_options = {"UNDO"}

    def execute(self, context: bpy.types.Context) -> Result:
        scene = scene_of_strip(active_strip(context))
        if context.window is not None:
            context.window.scene = scene
        root, layer = scene.playable_environment.root, scene.view_layers[0]
        if root is None or layer.objects.get(root.name) is None:
            self.report({"WARNING"}, f"scene {scene.name!r} has no environment any more")
            return {"FINISHED"}
        for each in layer.objects:
            each.select_set(each == root, view_layer=layer)
        layer.objects.active = root
        return {"FINISHED"}


CLASSES = (
    PLAYABLE_OT_render_again,
    PLAYABLE_OT_open_frames_folder,
    PLAYABLE_OT_select_environment,
)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
