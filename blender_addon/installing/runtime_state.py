"""What a Python has of the runtime, found out by starting it. No `bpy` here."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import pe_runtime
from pe_runtime.contract.errors import WorkerError
from pe_runtime.contract.messages import PROTOCOL

from ..worker.replies import WorkerCancelledError
from ..worker.runtime_python import RuntimePython
from ..worker.worker_client import WorkerClient, worker_command
from .processes import StoppedError, Watch, run

UNKNOWN, CHECKING, READY = "unknown", "checking", "ready"
MISSING, WRONG_VERSION, BROKEN = "missing", "wrong version", "broken"
FACTS = "playable facts "
PROBE = f"""
import json, sys
facts = {{"version": "", "protocol": 0, "device": "", "error": "", "missing": ""}}
try:
    import pe_runtime
    from pe_runtime.contract.messages import PROTOCOL
    facts.update(version=pe_runtime.__version__, protocol=PROTOCOL)
    if "--fake" in sys.argv:
        facts["device"] = "fake"
    elif PROTOCOL == {PROTOCOL}:
        import pe_runtime.worker.model_world, torch
        cuda = torch.cuda.is_available() and "cpu" not in sys.argv
        facts["device"] = torch.cuda.get_device_name(0) if cuda else "CPU"
except ModuleNotFoundError as error:
    facts.update(error=str(error), missing=error.name or "")
except BaseException as error:
    facts["error"] = f"{{type(error).__name__}}: {{error}}"
print("{FACTS}" + json.dumps(facts))
"""
"""Imports what the worker imports when it loads a model: a greeting alone would not prove it."""


@dataclass(frozen=True)
class RuntimeState:
    """What is known of the runtime.

    Attributes:
        kind: One of UNKNOWN CHECKING READY MISSING WRONG_VERSION BROKEN.
        python: The Python in question; empty: there is none.
        origin: Who named it, see `RuntimePython`.
        version: The runtime's version there, where it has one.
        device: What it would compute on, where it is READY.
        reason: What went wrong, where it is BROKEN.
    """

    kind: str = UNKNOWN
    python: str = ""
    origin: str = ""
    version: str = ""
    device: str = ""
    reason: str = ""


def check(
    found: RuntimePython | None,
    arguments: Sequence[str] = (),
    should_stop: Callable[[], bool] = lambda: False,
) -> RuntimeState:
    """Find out what a Python has of the runtime.

    Args:
        found: The Python; None: there is none.
        arguments: What workers are started with.
        should_stop: Asked now and then.

    Raises:
        StoppedError: It said so.
    """
    if found is None:
        return RuntimeState(MISSING)
    known = RuntimeState(BROKEN, found.python, found.origin)
    said: list[str] = []
    try:
        command = [found.python, "-I", "-X", "utf8", "-c", PROBE, *arguments]
        code = run(command, Watch(should_stop, said.append))
    except OSError as error:
        return replace(known, reason=str(error))
    facts = next((line for line in reversed(said) if line.startswith(FACTS)), None)
    if facts is None:
        last = "; ".join(said[-3:]) or "it said nothing"
        return replace(known, reason=f"exit code {code}: {last}")
    return _judge(known, json.loads(facts.removeprefix(FACTS)), arguments, should_stop)


def _judge(
    known: RuntimeState,
    facts: dict[str, str | int],
    arguments: Sequence[str],
    should_stop: Callable[[], bool],
) -> RuntimeState:
    known = replace(known, version=facts["version"])
    if facts["missing"].split(".")[0] == "pe_runtime" and not facts["version"]:
        return replace(known, kind=MISSING)
    if facts["version"] and (facts["version"], facts["protocol"]) != _ours():
        return replace(known, kind=WRONG_VERSION)
    if facts["error"]:
        return replace(known, reason=facts["error"])
    try:
        WorkerClient(worker_command(known.python, arguments), should_stop=should_stop).stop()
    except WorkerCancelledError as error:
        raise StoppedError from error
    except WorkerError as error:
        return replace(known, reason=str(error))
    return replace(known, kind=READY, device=facts["device"])


def _ours() -> tuple[str, int]:
    return pe_runtime.__version__, PROTOCOL
