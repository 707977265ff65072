"""What is known of the runtime, and what is being done about it. No `bpy` here.

One for this Blender, in the module, because it must outlive windows, files and operators.
"""

import os
from collections.abc import Callable, Sequence
from pathlib import Path

from pe_runtime.contract.errors import PlayableEnvironmentError

from ..worker.background import BackgroundCall, Work
from ..worker.runtime_python import VARIABLE, Places, find_python
from .plan import SetUpPlan
from .processes import StoppedError
from .runtime_state import CHECKING, RuntimeState, check
from .set_up import LOG, set_up

PARTS = 1000
"""Steps of a progress."""
LOG_LINES = 8
DONE = "The runtime is set up"
STOPPED = "Setting up was stopped; nothing of it is left"


class Installation:
    """At most one check or one set-up at a time.

    Attributes:
        state: What is known of the runtime.
        said: How the last set-up ended, in words; empty before one.
        failed: Whether it failed.
        log: The end of what its programs said, if it failed.
    """

    def __init__(self) -> None:
        self.state = RuntimeState()
        self.said = ""
        self.failed = False
        self.log: tuple[str, ...] = ()
        self._call: BackgroundCall | None = None
        self._plan: SetUpPlan | None = None
        self._adopt: Callable[[], None] = lambda: None

    @property
    def busy(self) -> bool:
        """Whether something is under way."""
        return self._call is not None

    @property
    def sets_up(self) -> bool:
        """Whether a set-up is under way."""
        return self._plan is not None

    @property
    def progress(self) -> tuple[str, float]:
        """What a set-up does, and the share that is done, in [0, 1]."""
        return (self._call.stage, self._call.progress) if self._call else ("", 0.0)

    def forget(self) -> None:
        """Know nothing: the runtime is looked for elsewhere from now on."""
        if not self.sets_up:
            self._end_call()
            self.state = RuntimeState()

    def begin_check(self, places: Places, arguments: Sequence[str] = ()) -> None:
        """Look, in the background, at the runtime that is found there."""
        if self.busy:
            return
        found = find_python(places, os.environ)
        self.state = RuntimeState(CHECKING, found.python if found else "")
        self._call = BackgroundCall(lambda stop, _: check(found, arguments, stop))

    def begin_set_up(
        self, plan: SetUpPlan, release: Callable[[], None], adopt: Callable[[], None]
    ) -> None:
        """Set the runtime up in the background; a check under way is dropped.

        Args:
            plan: What to set up.
            release: Called in the background: end what runs in the old runtime.
            adopt: Called by `settle` if all went well: have the new runtime be the one to use.
        """
        self._end_call()
        self._plan, self._adopt = plan, adopt
        self.said, self.failed, self.log = "", False, ()
        self._call = BackgroundCall(_work_of(plan, release))

    def cancel(self) -> None:
        """Give up what is under way; `settle` tells when that is done."""
        if self._call is not None:
            self._call.cancel()

    def settle(self, wait: bool = False) -> bool:
        """Take in what has ended.

        Args:
            wait: Until it has.

        Returns:
            Whether something was taken in.
        """
        if self._call is None or not (wait or self._call.done):
            return False
        call, plan = self._call, self._plan
        self._call, self._plan = None, None
        try:
            state = call.result()
            if plan:
                self._adopt()
                self.said = DONE
            # A farm's variable goes before what was set up here; that one has to be looked at.
            self.state = RuntimeState() if plan and os.environ.get(VARIABLE) else state
        except StoppedError:
            self.state, self.said = RuntimeState(), STOPPED if plan else self.said
        except PlayableEnvironmentError as error:
            self.state, self.said, self.failed = RuntimeState(), str(error), True
            self.log = last_lines(plan.folder) if plan else ()
        return True

    def end(self) -> None:
        """Give up what is under way, wait until it is gone, and know nothing."""
        self._end_call()
        self.__init__()

    def _end_call(self) -> None:
        if self._call is not None:
            self._call.cancel()
            self.settle(wait=True)


installation = Installation()


def last_lines(folder: Path) -> tuple[str, ...]:
    """The end of the log of a set-up."""
    try:
        lines = (folder / LOG).read_text(encoding="utf-8").splitlines()
    except OSError:
        return ()
    return tuple(line for line in lines if line.strip())[-LOG_LINES:]


def _work_of(plan: SetUpPlan, release: Callable[[], None]) -> Work:
    def work(should_stop: Callable[[], bool], on_progress: Callable) -> RuntimeState:
        def on_stage(stage: str, share: float) -> None:
            on_progress(stage, round(PARTS * share), PARTS)

        return set_up(plan, should_stop, on_stage, release)

    return work
