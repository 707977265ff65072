"""Rendering the range into a strip of the sequencer."""

import bpy
from bpy.props import StringProperty

from pe_runtime.contract.errors import PlayableEnvironmentError

from ..range_render import (
    RenderWatch,
    borrow_settings,
    job_for,
    lent_settings,
    show_in_sequencer,
)
from ..worker_operator import Result, allowed, end_modal, failed, show_progress, start_modal


class PLAYABLE_OT_render_to_sequencer(bpy.types.Operator):
    """Render the frame range and show it as one strip in the sequencer of the Edit scene."""

    bl_idname = "playable.render_to_sequencer"
    bl_label = "Render to Sequencer"
    bl_options = {"UNDO"}

    folder: StringProperty(name="Folder", description="Empty: the scene's setting")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        baked = context.scene.playable_environment.bake_text is not None
        return allowed(cls, baked, "Bake paths first")

    def execute(self, context: bpy.types.Context) -> Result:
        scene = context.scene
        try:
            job = job_for(scene, self.folder or scene.playable_environment.frames_folder)
            with lent_settings(scene, job):
                bpy.ops.render.render(animation=True, scene=scene.name)
            strip = show_in_sequencer(scene, job)
        except (PlayableEnvironmentError, RuntimeError) as error:
            return failed(self, error)
        self.report({"INFO"}, f"{len(job.files)} frames in strip {strip.name!r}")
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        scene = context.scene
        try:
            self._job = job_for(scene, self.folder or scene.playable_environment.frames_folder)
        except PlayableEnvironmentError as error:
            return failed(self, error)
        take, self._give_back = borrow_settings(scene, self._job)
        take()
        self._watch = RenderWatch()
        start_modal(self, context)
        bpy.ops.render.render("INVOKE_DEFAULT", animation=True, scene=scene.name)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if event.type != "TIMER":
            return {"PASS_THROUGH"}  # Esc too: Blender's own render job listens for it
        watch, count = self._watch, len(self._job.files)
        show_progress(context, f"Rendering {watch.written} of {count}", watch.written / count)
        if not watch.ended or bpy.app.is_job_running("RENDER"):
            return {"RUNNING_MODAL"}
        end_modal(self, context)
        watch.close()
        self._give_back()
        if watch.cancelled:
            self.report({"WARNING"}, "Rendering stopped; the strip is as it was")
            return {"CANCELLED"}
        try:
            show_in_sequencer(bpy.data.scenes[self._job.scene_name], self._job)
        except PlayableEnvironmentError as error:
            return failed(self, error)
        _show_edit_scene(context, bpy.data.scenes[self._job.scene_name])
        return {"FINISHED"}


def _show_edit_scene(context: bpy.types.Context, scene: bpy.types.Scene) -> None:
    # Since 5.0 a sequencer editor shows the workspace's scene, and none is chosen at first.
    if getattr(context.workspace, "sequencer_scene", scene) is None:
        context.workspace.sequencer_scene = scene.playable_environment.edit_scene


CLASSES = (PLAYABLE_OT_render_to_sequencer,)


def register() -> None:
    """Register the operator."""
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister() -> None:
    """Undo `register`."""
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
