"""A fake worker that misbehaves on purpose: `python faulty_worker.py MODE`."""

import os
import sys
import time

from pe_runtime.contract.errors import CameraError
from pe_runtime.worker.fake_world import FakeWorld
from pe_runtime.worker.serving import Inbox, serve

BAD_FRAME = 3


class FailingWorld(FakeWorld):
    """Refuses one frame."""

    def render(self, shot, frames, whole=None):
        if BAD_FRAME in frames:
            raise CameraError("the lens fell off")
        yield from super().render(shot, frames, whole)


class DyingWorld(FakeWorld):
    """Takes the process along at one frame."""

    def render(self, shot, frames, whole=None):
        if BAD_FRAME in frames:
            sys.stderr.write("out of memory, or so\n")
            sys.stderr.flush()
            os._exit(7)
        yield from super().render(shot, frames, whole)


class SmallWorld(FakeWorld):
    """Draws half of the pixels that were asked for."""

    def render(self, shot, frames, whole=None):
        for picture in super().render(shot, frames, whole):
            picture.buffers["rgb"] = picture.buffers["rgb"][::2, ::2].copy()
            yield picture


class SlowlyLoadedWorld(FakeWorld):
    """Takes its time to load."""

    def load(self, model):
        time.sleep(1.0)
        return super().load(model)


class SlowlyPreparedWorld(FakeWorld):
    """Takes its time to predict."""

    def rollout(self, shot):
        time.sleep(1.0)
        return super().rollout(shot)


class SlowlyEncodedWorld(FakeWorld):
    """Takes its time to look at a picture."""

    def encode(self, image, camera, boxes):
        time.sleep(1.0)
        return super().encode(image, camera, boxes)


WORLDS = {
    "fails": FailingWorld,
    "dies": DyingWorld,
    "small": SmallWorld,
    "slow_to_load": SlowlyLoadedWorld,
    "slow_to_prepare": SlowlyPreparedWorld,
    "slow_to_encode": SlowlyEncodedWorld,
    "slow": lambda: FakeWorld(seconds_per_frame=1.0),
}


def main(mode):
    if mode == "silent":
        time.sleep(60)
    if mode == "chatty":
        sys.stdout.write("Hello, I am a library that greets its users!\n")
        sys.stdout.flush()
        time.sleep(60)
    if mode == "broken":
        raise SystemExit("ModuleNotFoundError: No module named 'torch'")
    source, sink = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    return serve(WORLDS[mode], Inbox(source), sink)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
