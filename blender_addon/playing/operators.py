"""Letting the model act out the keyed actions."""

import bpy

from .. import playables
from ..keyed_paths import write_bake
from ..polls import has_environment, not_rendering
from ..scene_bridge import sample_range, shot_from_moments
from ..worker.replies import PredictedPaths
from ..worker.session import session
from ..worker.worker_operator import Task, WorkerOperator, model_path
from .signature import signature_of
from .stepping import action_warnings, step_actions
from .watching import live


class PLAYABLE_OT_bake_paths(WorkerOperator, bpy.types.Operator):
    """Let the model act out the action keys, seen by the animated camera, and key the paths"""

    bl_idname = "playable.bake_paths"
    bl_label = "Bake Paths"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_environment(cls, context.scene) and not_rendering(cls)

    def task(self, context: bpy.types.Context) -> Task:
        scene = context.scene
        name, settings = scene.name, scene.playable_environment
        start = playables.stored_start(settings)
        step_actions(scene)
        signature = signature_of(scene)
        moments = sample_range(scene, range(scene.frame_start, scene.frame_end + 1))
        shot = shot_from_moments(scene, start, model_path(settings.model), moments)

        def finish(paths: PredictedPaths) -> str:
            write_bake(bpy.data.scenes[name], shot, paths, moments)
            live.remember(bpy.data.scenes[name], signature, moments)
            done = f"Baked {len(shot.objects)} paths over {len(moments)} frames"
            return "; ".join([done, *action_warnings(bpy.data.scenes[name])])

        return Task(lambda stop, progress: session.rollout(shot, stop, progress), finish)


CLASSES = (PLAYABLE_OT_bake_paths,)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
