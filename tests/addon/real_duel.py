"""The shipped model on a small picture grid: its clip's first frame, and the worker that has it."""

import sys

from blender_addon.worker.worker_client import worker_command
from pe_runtime.contract.shot import SHOT_VERSION, ObjectTrack, Shot
from pe_runtime.environment import MODELS
from pe_runtime.shots.clips import start_from_clip

WORKER = worker_command(sys.executable)
WIDTH, HEIGHT = 64, 36


def duel_start():
    return start_from_clip(MODELS / "duel_clip")


def duel_shot(start=None, frames=3, actions=((1, 3),), **changes):
    """Both players act, one camera, 5 fps: a frame is a step of the model."""
    begin = duel_start()
    fields = {
        "version": SHOT_VERSION,
        "model": "duel",
        "start": start or begin,
        "fps": 5.0,
        "frame_start": 1,
        "frame_end": frames,
        "cameras": (begin.camera.scaled(WIDTH, HEIGHT),) * frames,
        "objects": tuple(ObjectTrack(name, actions) for name in begin.boxes),
        "passes": ("depth",),
    }
    return Shot(**(fields | changes))
