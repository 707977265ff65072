"""The plainest client of a real worker process, and a small shot to ask it for."""

import contextlib
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np

import pe_runtime
from pe_runtime.contract.camera import Camera, project
from pe_runtime.contract.messages import PROTOCOL, Message, read_message, write_message
from pe_runtime.contract.shot import ObjectTrack, Shot
from pe_runtime.worker.fake_world import ACTIONS

ROOT = Path(__file__).parents[1]
HELLO = Message("hello", {"protocol": PROTOCOL, "version": pe_runtime.__version__})
LOAD = Message("load", {"model": "duel"})
PLACES = {"player_1": (-1.0, 0.0, 0.0), "player_2": (1.0, 0.5, 0.0)}


def camera(x=0.0, width=256, height=144):
    """At 8 m before the origin, 2 m up, looking along +y and a little down."""
    slope = np.array([0.0, 1.0, -0.125]) / np.hypot(1.0, 0.125)
    down = np.cross(slope, [1.0, 0.0, 0.0])
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = [1, 0, 0], down, slope, [x, -8.0, 2.0]
    focal = 1.1 * width
    intrinsics = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1.0]])
    return Camera(width, height, intrinsics, pose)


def boxes(places=PLACES):
    """Boxes of 20 pixels width whose lower edges stand at the places."""
    found = {}
    for name, place in places.items():
        ((x, y),), _ = project(camera(), np.array([place]))
        found[name] = (x - 10.0, y - 50.0, x + 10.0, y)
    return found


def make_shot(start, frames=13, fps=12.0, **changes):
    left, back = ACTIONS.index("left"), ACTIONS.index("back")
    content = {
        "version": 1,
        "model": "duel",
        "start": start,
        "fps": fps,
        "frame_start": 1,
        "frame_end": frames,
        "cameras": tuple(camera(0.01 * index) for index in range(frames)),
        "objects": (ObjectTrack("player_1", ((1, left),)), ObjectTrack("player_2", ((1, back),))),
    }
    return Shot(**(content | changes))


class Worker:
    """A real worker process and the plainest client there is."""

    def __init__(self, *arguments, code=None):
        program = ["-c", code] if code else ["-m", "pe_runtime.worker", *arguments]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(
            [sys.executable, *program], cwd=ROOT, stdin=pipe, stdout=pipe, stderr=pipe
        )
        self.log = []
        self.drain = threading.Thread(target=lambda: self.log.extend(self.process.stderr))
        self.drain.start()

    def send(self, message):
        write_message(self.process.stdin, message)

    def receive(self):
        return read_message(self.process.stdout)

    def ask(self, message):
        self.send(message)
        return self.receive()

    def ready(self):
        assert self.ask(HELLO).type == "ready"
        return self.ask(LOAD)

    def until_terminal(self):
        replies = [self.receive()]
        while replies[-1].type in ("frame", "progress"):
            replies.append(self.receive())
        return replies

    def end(self):
        with contextlib.suppress(BrokenPipeError):
            self.process.stdin.close()
        code = self.process.wait(30)
        self.drain.join()
        self.process.stdout.close()
        self.process.stderr.close()
        return code


def render(shot, frames=None):
    return Message("render", {"shot": shot.as_dict(), "frames": frames})
