"""Leaving the predicted path, and following it again."""

import bpy
from bpy.props import EnumProperty

from pe_runtime.contract.errors import PlayableEnvironmentError

from ..bake import bake_of
from ..playing.stand_in import moment_at, stand_in_for
from ..polls import has_bake
from ..worker.worker_operator import Result, failed
from .places import ALL, FRAME, ONWARDS, follow_path, leave_path
from .pose_operators import can_be_keyed

EXTENTS = (
    (FRAME, "At This Frame", "Only at the current frame"),
    (ONWARDS, "From Here On", "From the current frame to the end of the baked range"),
    (ALL, "At All Frames", "Forget every key of location and turn, and where it was free"),
)


class PLAYABLE_OT_leave_path(bpy.types.Operator):
    """Free the active object of its path"""

    bl_idname = "playable.leave_path"
    bl_label = "Leave the Path"
    bl_description = (
        "From this frame to its next Follow key, let the active object stand where its own keys of "
        "location and rotation put it; baking leaves those keys alone"
    )
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_be_keyed(cls, context.object)

    def execute(self, context: bpy.types.Context) -> Result:
        try:
            leave_path(context.object, context.scene.frame_current)
        except PlayableEnvironmentError as error:
            return failed(self, error)
        return {"FINISHED"}


class PLAYABLE_OT_follow_path(bpy.types.Operator):
    """Put the active object back on the path that was baked for it"""

    bl_idname = "playable.follow_path"
    bl_label = "Follow the Path Again"
    bl_options = {"REGISTER", "UNDO"}

    extent: EnumProperty(
        name="Frames", description="Where its own keys give way to the path", items=EXTENTS
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_be_keyed(cls, context.object) and has_bake(cls, context.scene)

    def execute(self, context: bpy.types.Context) -> Result:
        scene, target = context.scene, context.object
        try:
            bake = bake_of(scene.playable_environment)
            if target.playable.object_name not in bake.paths:
                return failed(self, f"nothing is baked for {target.name!r}; press Bake Paths again")
            with stand_in_for(scene) as stand_in:
                moments = [moment_at(stand_in, frame) for frame in bake.shot.frames]
            follow_path(scene, target, bake, moments, self.extent)
        except PlayableEnvironmentError as error:
            return failed(self, error)
        return {"FINISHED"}


CLASSES = (PLAYABLE_OT_leave_path, PLAYABLE_OT_follow_path)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
