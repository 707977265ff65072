"""What can be done to the worker."""

import bpy

from ..session import session
from ..worker_operator import Result, allowed


class PLAYABLE_OT_stop_worker(bpy.types.Operator):
    """End the worker process; the next request starts another."""

    bl_idname = "playable.stop_worker"
    bl_label = "Stop Worker"

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        return allowed(cls, session.worker_pid is not None, "No worker is running")

    def execute(self, _context: bpy.types.Context) -> Result:
        session.close()
        return {"FINISHED"}


CLASSES = (PLAYABLE_OT_stop_worker,)


def register() -> None:
    """Register the operator."""
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister() -> None:
    """Undo `register`."""
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
