"""Rendering a range into files, and into a strip of the sequencer.

Without a window they do the same, and what was finished before is not drawn again:

    blender -b film.blend --python-exit-code 1 --python-expr \
        "import bpy; bpy.ops.playable.render_to_sequencer(); bpy.ops.wm.save_mainfile()"
    blender -b film.blend --python-exit-code 1 --python-expr \
        "import bpy; bpy.ops.playable.render_range(frame_start=1, frame_end=120)"
"""

import json
from collections.abc import Iterable

import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.props import IntProperty, StringProperty

from ..polls import allowed, has_bake, not_rendering
from ..worker.worker_operator import Result
from .job import RangeJob, source_of
from .placing import StripPlan, place_strip
from .provenance import provenance_of
from .range_operator import RangeOperator
from .running import Outcome
from .target import leave_sequencer_out, shadowed, target_of, target_warnings


class PLAYABLE_OT_render_to_sequencer(RangeOperator, bpy.types.Operator):
    """Render what is missing or has changed, and show the range as one strip in a sequencer"""

    bl_idname = "playable.render_to_sequencer"
    bl_label = "Render to Sequencer"
    bl_options = {"UNDO"}

    folder: StringProperty(
        name="Folder", description="Empty: the scene's setting", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _can_render(cls, context.scene)

    def frames_folder(self, context: bpy.types.Context) -> str:
        return self.folder or super().frames_folder(context)

    def conclude(self, context: bpy.types.Context, job: RangeJob, outcome: Outcome) -> None:
        show_in_sequencer(self, context, job, outcome)


class PLAYABLE_OT_render_range(RangeOperator, bpy.types.Operator):
    """Render what is missing or has changed to files, without a strip; for scripts and farms"""

    bl_idname = "playable.render_range"
    bl_label = "Render Range to Files"
    bl_options = {"UNDO"}

    folder: StringProperty(
        name="Folder", description="Empty: the scene's setting", options={"SKIP_SAVE"}
    )
    frame_start: IntProperty(
        name="Start", description="First frame; the scene's unless set", options={"SKIP_SAVE"}
    )
    frame_end: IntProperty(
        name="End", description="Last frame; the scene's unless set", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _can_render(cls, context.scene)

    def frames_folder(self, context: bpy.types.Context) -> str:
        return self.folder or super().frames_folder(context)

    def frames(self, scene: bpy.types.Scene) -> tuple[int, int]:
        chosen = self.properties.is_property_set
        first = self.frame_start if chosen("frame_start") else scene.frame_start
        return first, self.frame_end if chosen("frame_end") else scene.frame_end


class PLAYABLE_OT_overwrite_frames(bpy.types.Operator):
    """Ask whether files may be lost, and render again if so"""

    bl_idname = "playable.overwrite_frames"
    bl_label = "Overwrite Files?"
    bl_options = {"INTERNAL"}

    job: StringProperty(description="Name of the operator that renders", options={"HIDDEN"})
    options: StringProperty(description="Its options, as JSON", options={"HIDDEN"})
    count: IntProperty(description="How many files would be lost", options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        return context.window_manager.invoke_confirm(
            self,
            event,
            title="Overwrite Files?",
            message=iface_(
                "Files in the frames folder that this job has not rendered, or that were changed "
                "since: {count}. Rendering would replace them."
            ).format(count=self.count),
            confirm_text="Overwrite",
            icon="WARNING",
        )

    def execute(self, _context: bpy.types.Context) -> Result:
        render = getattr(bpy.ops.playable, self.job)
        render("INVOKE_DEFAULT", **(json.loads(self.options or "{}") | {"overwrite": True}))
        return {"FINISHED"}


class PLAYABLE_OT_leave_sequencer_out(bpy.types.Operator):
    """Switch the sequencer off for rendering, so that the scene's environment is rendered"""

    bl_idname = "playable.leave_sequencer_out"
    bl_label = "Render the Environment Instead"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        hidden = shadowed(context.scene) != ""
        return allowed(cls, hidden, "The environment is rendered already")

    def execute(self, context: bpy.types.Context) -> Result:
        context.scene.render.use_sequencer = False
        return {"FINISHED"}


def show_in_sequencer(
    operator: bpy.types.Operator, context: bpy.types.Context, job: RangeJob, outcome: Outcome
) -> bpy.types.Strip:
    """Put a finished job's files into the scene's strip, and say what looks different there."""
    scene = source_of(job)
    strips, target = scene.playable_environment.strips, target_of(scene)
    plan = StripPlan(
        job.id,
        scene.name,
        job.files,
        job.frame_start + strips.frame_offset,
        strips.channel,
        provenance_of(scene, job, outcome.facts, outcome.drawn > 0),
    )
    strip = place_strip(target, plan)
    leave_sequencer_out(target)
    for warning in target_warnings(scene, target):
        operator.report({"WARNING"}, warning)
    show_where_none_is_chosen(bpy.data.workspaces, target)
    return strip


def show_where_none_is_chosen(workspaces: Iterable[object], target: bpy.types.Scene) -> None:
    """Have sequencers show a scene that show none: since 5.0 a workspace chooses it for them."""
    for each in workspaces:
        if getattr(each, "sequencer_scene", target) is None:
            each.sequencer_scene = target


def _can_render(operator: type, scene: bpy.types.Scene) -> bool:
    return has_bake(operator, scene) and not_rendering(operator)


CLASSES = (
    PLAYABLE_OT_render_to_sequencer,
    PLAYABLE_OT_render_range,
    PLAYABLE_OT_overwrite_frames,
    PLAYABLE_OT_leave_sequencer_out,
)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
