"""Programs that take minutes: read line by line, ended with their children. No `bpy` here."""

import contextlib
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

TICK_SECONDS = 0.1
END_SECONDS = 10.0
OnLine = Callable[[str], None]


@dataclass(frozen=True)
class Watch:
    """Who follows a program.

    Attributes:
        should_stop: Asked at every tick; yes ends the program.
        on_line: Called with every line that it says.
        on_tick: Called now and then, also while it says nothing.
    """

    should_stop: Callable[[], bool] = lambda: False
    on_line: OnLine = lambda _line: None
    on_tick: Callable[[], None] = lambda: None


class StoppedError(Exception):
    """A program was ended because its watch said so."""


Changes = Mapping[str, str | None]
"""Environment variables beside those of Blender; None takes one away."""


def run(command: Sequence[str], watch: Watch, changes: Changes | None = None) -> int:
    """Run a program to its end.

    Args:
        command: Program and arguments.
        watch: Who follows it.
        changes: To the variables of Blender.

    Returns:
        Its exit code.

    Raises:
        OSError: It cannot be started.
        StoppedError: The watch said so; the program and its children have ended.
    """
    process = subprocess.Popen(
        list(command),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env=program_environment(changes),
        **_own_group(),
    )
    lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
    reader = threading.Thread(
        target=_read, args=(process.stdout, lines), daemon=True, name="playable program"
    )
    reader.start()
    try:
        _follow(process, lines, watch)
        return process.wait()
    except BaseException:  # whatever it is, nobody else could end the program
        end_tree(process)
        raise
    finally:
        reader.join(END_SECONDS)
        process.stdout.close()


def program_environment(changes: Changes | None = None) -> dict[str, str]:
    """The variables for another Python than Blender's, whose own are not for it."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    changed = kept | dict(changes or {})
    return {name: value for name, value in changed.items() if value is not None}


def end_tree(process: subprocess.Popen) -> None:
    """End a program that `run` started, and its children."""
    if sys.platform == "win32":
        tree = ["taskkill", "/F", "/T", "/PID", str(process.pid)]
        subprocess.run(tree, capture_output=True, creationflags=subprocess.CREATE_NO_WINDOW)
    else:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(END_SECONDS)


def _own_group() -> dict[str, int | bool]:
    """Have the program's children belong to it, so that they can be ended together."""
    if sys.platform == "win32":
        return {"creationflags": subprocess.CREATE_NO_WINDOW | subprocess.CREATE_NEW_PROCESS_GROUP}
    return {"start_new_session": True}


def _read(stream: object, lines: "queue.SimpleQueue[str | None]") -> None:
    with contextlib.suppress(ValueError, OSError):
        for line in stream:
            lines.put(line.decode("utf-8", "replace").rstrip())
    lines.put(None)


def _follow(
    process: subprocess.Popen, lines: "queue.SimpleQueue[str | None]", watch: Watch
) -> None:
    """Pass lines on until the last one, or until the program has ended.

    A child that outlives the program may keep its output open; it is not waited for.
    """
    ticked = 0.0
    while True:
        if watch.should_stop():
            raise StoppedError
        if time.monotonic() - ticked > TICK_SECONDS:
            ticked = time.monotonic()
            watch.on_tick()
        try:
            line = lines.get(timeout=TICK_SECONDS)
        except queue.Empty:
            if process.poll() is not None:
                return
            continue
        if line is None:
            return
        watch.on_line(line)
