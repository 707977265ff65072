"""Holding a pose, and letting it move again."""

import bpy
from bpy.app.translations import pgettext_tip as tip_
from bpy.props import BoolProperty

from pe_runtime.contract.errors import PlayableEnvironmentError

from ..polls import allowed, playable_chosen
from ..worker.worker_operator import Result, failed
from .key_history import POSE_PATH, key_from

HOLDING = "Keep the pose of this frame from here on, wherever the object goes (keys Held)"
FREEING = "Let the limbs move as the model predicts from here on (keys Free)"


class PLAYABLE_OT_hold_pose(bpy.types.Operator):
    """Key the active object's pose at this frame: held as it is now, or free again"""

    bl_idname = "playable.hold_pose"
    bl_label = "Hold Pose"
    bl_options = {"REGISTER", "UNDO"}

    hold: BoolProperty(
        name="Hold", description="Hold the pose; off lets it move again", default=True
    )

    @classmethod
    def description(
        cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties
    ) -> str:
        if properties.hold:
            return tip_(HOLDING)
        return tip_(FREEING)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_be_keyed(cls, context.object)

    def execute(self, context: bpy.types.Context) -> Result:
        target, frame = context.object, context.scene.frame_current
        try:
            key_from(target, POSE_PATH, frame, "HELD" if self.hold else "FREE", "FREE")
        except PlayableEnvironmentError as error:
            return failed(self, error)
        return {"FINISHED"}


def can_be_keyed(operator: type, chosen: bpy.types.Object | None) -> bool:
    """Whether an object is a playable one and this file's own, for a poll."""
    if not playable_chosen(operator, chosen):
        return False
    return allowed(
        operator, chosen.is_editable, "It is linked from another file; make a library override"
    )


CLASSES = (PLAYABLE_OT_hold_pose,)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
