"""The worker as a process: who owns stdin and stdout, and which world answers."""

import io
import os
import sys
from collections.abc import Callable

from pe_runtime.contract.errors import WorkerError
from pe_runtime.worker.serving import Inbox, serve
from pe_runtime.worker.world import World


class SilentStdout(io.TextIOBase):
    """Stands in for stdout, whose file is the wire: writing to it raises."""

    def writable(self) -> bool:
        """Text may be offered; it is refused with a reason."""
        return True

    def write(self, text: str) -> int:
        """Refuse.

        Raises:
            WorkerError: Always.
        """
        raise WorkerError(
            f"something in the worker printed {text[:80]!r}: stdout is the wire to Blender; "
            "print to sys.stderr or use logging"
        )


def run_worker(fake: bool = False, device: str = "auto") -> int:
    """Serve the wire on this process's stdin and stdout until `stop` or the end of stdin.

    Args:
        fake: Answer with a moving gradient instead of a trained environment; needs no torch.
        device: Where a trained environment computes.

    Returns:
        Exit code: 0 after `stop` or a clean end, 1 if the wire broke.
    """
    # The reader thread may still wait in a read at exit; Python could not close its own stdin then.
    source = os.fdopen(os.dup(0), "rb")
    sink = os.fdopen(os.dup(1), "wb")
    # From here on file 1 is stderr, for libraries in C, and print() raises.
    os.dup2(2, 1)
    sys.stdout = SilentStdout()
    try:
        return serve(_world_maker(fake, device), Inbox(source), sink)
    except BrokenPipeError:
        return 1


def _world_maker(fake: bool, device: str) -> Callable[[], World]:
    """A function that makes the world when it is first needed: torch takes seconds to import."""

    def make() -> World:
        if fake:
            from pe_runtime.worker.fake_world import FakeWorld

            return FakeWorld()
        from pe_runtime.worker.model_world import ModelWorld

        return ModelWorld(device)

    return make
