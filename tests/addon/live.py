"""Time for live paths, in tests: ticks without Blender's timer, until nothing is left to do."""

import time

from blender_addon.playing.live_paths import IDLE, LivePaths
from blender_addon.worker.session import session

DEADLINE = 60.0


class Clock:
    """Ticks that pass quicker than the seconds they stand for."""

    def __init__(self, predict=session.rollout):
        self.shots, self.now, self._predict = [], 0.0, predict
        self.live = LivePaths(self._noted)

    def _noted(self, shot, *arguments, **options):
        assert options == {"yielding": True}
        self.shots.append(shot)
        return self._predict(shot, *arguments, **options)

    def settle(self):
        """Something may have changed: tick until all of it is dealt with; how often it took."""
        self.live.touch()
        return self.run_until(lambda seconds: seconds == IDLE)

    def run_until(self, over):
        deadline, ticks = time.monotonic() + DEADLINE, 0
        while time.monotonic() < deadline:
            seconds, ticks = self.live.tick(self.now), ticks + 1
            if over(seconds):
                return ticks
            self.now += seconds
            time.sleep(0.001)
        raise AssertionError(f"still busy after {ticks} ticks")
