"""What is said about the runtime: its state, the question before a set-up, refusals. No `bpy`."""

import textwrap
from dataclasses import dataclass

import pe_runtime

from ..runtime_python import CHOSEN, OWN, PRIVATE, VARIABLE
from .plan import GIGABYTE, SetUpPlan, offers_choice
from .runtime_state import BROKEN, CHECKING, MISSING, READY, UNKNOWN, WRONG_VERSION, RuntimeState

LINE_CHARACTERS, PANEL_CHARACTERS = 78, 36
WAY = "Drawing needs a runtime beside Blender. It is set up once"
ICONS = {
    UNKNOWN: "QUESTION",
    CHECKING: "SORTTIME",
    READY: "CHECKMARK",
    MISSING: "INFO",
    WRONG_VERSION: "ERROR",
    BROKEN: "ERROR",
}
ORIGINS = {
    VARIABLE: f"named by the environment variable {VARIABLE}",
    CHOSEN: "chosen in the preferences",
    PRIVATE: "set up by this add-on",
    OWN: "Blender's own",
}
ALLOW_ONLINE = (
    "Setting up downloads files, and Blender's online access is off; "
    "turn on Allow Online Access in Preferences > System > Network"
)
STARTED_OFFLINE = (
    "Setting up downloads files, and this Blender was started with --offline-mode; "
    "start it without, or choose a Python that has the runtime"
)
NO_WHEEL = (
    "This copy of the add-on brings no runtime along: install the extension's zip, which "
    "`pe extension build` makes, or choose a Python that has playable-environments"
)
SETTING_UP = "The runtime is being set up"


@dataclass(frozen=True)
class Words:
    """What a part of the window shows: an icon, a line, and more lines below it."""

    icon: str
    title: str
    lines: tuple[str, ...] = ()


def words_of(state: RuntimeState) -> Words:
    """The state of the runtime, for people."""
    lines = () if not state.python else wrapped(_whereabouts(state))
    return Words(ICONS[state.kind], _title(state), (*wrapped(_advice(state)), *lines))


def short_words(state: RuntimeState) -> str:
    """The state of the runtime in one line, for where there is no room."""
    return _title(state)


def worker_words(status: str, doing: str, device: str, error: str) -> Words:
    """The worker, for the panel.

    Args:
        status: As `Session.status`.
        doing: As `Session.doing`.
        device: What the loaded model computes on; empty: none is loaded.
        error: As `Session.error`.
    """
    if error:
        return Words("ERROR", "The worker failed", wrapped(error.splitlines()[0], PANEL_CHARACTERS))
    if doing or status in ("busy", "starting"):
        return Words("SORTTIME", doing or ("Drawing" if status == "busy" else "Starting"))
    if status == "ready":
        return Words("CHECKMARK", f"Ready on {device}" if device else "Ready")
    return Words("CONSOLE", "Starts when it is needed")


def question_lines(plan: SetUpPlan) -> tuple[str, ...]:
    """What somebody must know before agreeing to a set-up."""
    cost = plan.cost
    return (
        *wrapped(f"Folder: {plan.environment}"),
        *wrapped(f"Made of: {plan.base_python}"),
        f"Download: about {size_in_words(cost.download)} from {' and '.join(plan.sources)}",
        f"Disk: about {size_in_words(cost.disk)} while it is set up",
        "It takes some minutes, in which you can go on working",
        "Blender itself and your other add-ons are not touched",
    )


def refusal(online: bool, started_offline: bool, has_wheel: bool, sets_up: bool) -> str:
    """Why nothing can be set up now; empty: it can."""
    if sets_up:
        return SETTING_UP
    if not has_wheel:
        return NO_WHEEL
    if not online:
        return STARTED_OFFLINE if started_offline else ALLOW_ONLINE
    return ""


def processor_hint(plan: SetUpPlan) -> str:
    """What choosing the other processor would mean; empty where there is no choice."""
    if not offers_choice(plan.system):
        return ""
    return "GPU: for an NVIDIA card, a far larger download. CPU: runs everywhere"


def size_in_words(count: int) -> str:
    """A number of bytes as people say it."""
    if count >= GIGABYTE:
        return f"{count / GIGABYTE:.1f} GB".replace(".0 ", " ")
    return f"{round(count / 10**6)} MB"


def wrapped(text: str, characters: int = LINE_CHARACTERS) -> tuple[str, ...]:
    """A text as lines of at most so many characters."""
    return tuple(line for part in text.splitlines() for line in textwrap.wrap(part, characters))


def _title(state: RuntimeState) -> str:
    titles = {
        UNKNOWN: "Not checked yet",
        CHECKING: "Checking the runtime",
        READY: f"Ready: version {state.version} on {state.device}",
        MISSING: "There is no runtime in this Python" if state.python else "No runtime yet",
        WRONG_VERSION: f"Wrong version: {_versions(state)}",
        BROKEN: "The runtime cannot start",
    }
    return titles[state.kind]


def _versions(state: RuntimeState) -> str:
    if state.version == pe_runtime.__version__:
        return f"the runtime is another build of {state.version} than this add-on"
    return f"the runtime is {state.version}, this add-on needs {pe_runtime.__version__}"


def _advice(state: RuntimeState) -> str:
    if state.kind == BROKEN:
        return state.reason
    if state.kind == MISSING and state.python:
        return "Choose another Python, or empty the field and press Set Up Runtime"
    if state.kind == MISSING:
        return "Press Set Up Runtime, or choose a Python that has playable-environments"
    if state.kind == WRONG_VERSION:
        return "Press Set Up Runtime to replace it, or install the right version there"
    return ""


def _whereabouts(state: RuntimeState) -> str:
    origin = ORIGINS.get(state.origin, "")
    return f"Python: {state.python}" + (f" ({origin})" if origin else "")
