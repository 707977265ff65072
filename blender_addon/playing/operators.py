"""Keying actions, and letting the model act them out."""

import bpy
from bpy.props import EnumProperty

from pe_runtime.contract.errors import PlayableEnvironmentError

from .. import playables
from ..keyed_paths import write_bake
from ..replies import PredictedPaths
from ..scene_bridge import action_names, sample_range, shot_from_moments
from ..session import session
from ..settings import action_items
from ..worker_operator import Result, Task, WorkerOperator, allowed, failed, model_path


class PLAYABLE_OT_bake_paths(WorkerOperator, bpy.types.Operator):
    """Let the model act out the action keys, seen by the animated camera, and key the paths."""

    bl_idname = "playable.bake_paths"
    bl_label = "Bake Paths"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        root = context.scene.playable_environment.root
        return allowed(cls, root is not None, "Make a New Playable Environment first")

    def task(self, context: bpy.types.Context) -> Task:
        scene = context.scene
        name, settings = scene.name, scene.playable_environment
        start = playables.stored_start(settings)
        moments = sample_range(scene, range(scene.frame_start, scene.frame_end + 1))
        shot = shot_from_moments(scene, start, model_path(settings.model), moments)

        def finish(paths: PredictedPaths) -> str:
            write_bake(bpy.data.scenes[name], shot, paths, moments)
            return f"Baked {len(shot.objects)} paths over {len(moments)} frames"

        return Task(lambda stop, progress: session.rollout(shot, stop, progress), finish)


class PLAYABLE_OT_insert_action_key(bpy.types.Operator):
    """Let the active playable object do an action from this frame to its next key."""

    bl_idname = "playable.insert_action_key"
    bl_label = "Insert Action Key"
    bl_options = {"REGISTER", "UNDO"}

    action: EnumProperty(
        name="Action",
        description="What the object does from this frame on",
        items=lambda _self, context: action_items(_names_in(context)),
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        chosen = context.object is not None and context.object.playable.is_playable
        if not allowed(cls, chosen, "Select a playable Empty first"):
            return False
        return allowed(cls, bool(action_names(context.object)), "The model has no actions for it")

    def execute(self, context: bpy.types.Context) -> Result:
        action = int(self.action.removeprefix("A"))
        try:
            playables.key_action(context.object, context.scene.frame_current, action)
        except PlayableEnvironmentError as error:
            return failed(self, error)
        return {"FINISHED"}


def _names_in(context: bpy.types.Context | None) -> str:
    chosen = context.object if context is not None else None
    return chosen.playable.action_names if chosen is not None else ""


CLASSES = (PLAYABLE_OT_bake_paths, PLAYABLE_OT_insert_action_key)


def register() -> None:
    """Register the operators."""
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister() -> None:
    """Undo `register`."""
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
