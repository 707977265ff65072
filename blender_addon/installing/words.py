"""What is said about the runtime: its state, the question before a set-up, refusals. No `bpy`."""

from collections.abc import Callable
from dataclasses import dataclass

import pe_runtime

from ..worker.runtime_python import CHOSEN, OWN, PRIVATE, VARIABLE
from ..wrapping import SIDEBAR_CHARACTERS, wrapped
from .plan import GIGABYTE, SetUpPlan, offers_choice
from .runtime_state import BROKEN, CHECKING, MISSING, READY, UNKNOWN, WRONG_VERSION, RuntimeState

LINE_CHARACTERS = 78
"""What the preferences show in a line."""
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
    VARIABLE: "Python: {python} (named by the environment variable {variable})",
    CHOSEN: "Python: {python} (chosen in the preferences)",
    PRIVATE: "Python: {python} (set up by this add-on)",
    OWN: "Python: {python} (Blender's own)",
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
Translate = Callable[[str], str]
"""A sentence in another language; `str` leaves it as it is."""


@dataclass(frozen=True)
class Words:
    """What a part of the window shows: an icon, a line, and more lines below it."""

    icon: str
    title: str
    lines: tuple[str, ...] = ()


def words_of(state: RuntimeState, translate: Translate = str) -> Words:
    """The state of the runtime, for people."""
    advice = wrapped(translate(_advice(state)), LINE_CHARACTERS)
    lines = () if not state.python else wrapped(_whereabouts(state, translate), LINE_CHARACTERS)
    return Words(ICONS[state.kind], _title(state, translate), (*advice, *lines))


def short_words(state: RuntimeState) -> str:
    """The state of the runtime in one line, for where there is no room."""
    return _title(state)


def worker_words(
    status: str, doing: str, device: str, error: str, translate: Translate = str
) -> Words:
    """The worker, for the panel.

    Args:
        status: As `Session.status`.
        doing: As `Session.doing`.
        device: What the loaded model computes on; empty: none is loaded.
        error: As `Session.error`.
        translate: Into the language of the interface.
    """
    if error:
        return Words(
            "ERROR", "The worker failed", wrapped(error.splitlines()[0], SIDEBAR_CHARACTERS)
        )
    if doing or status in ("busy", "starting"):
        return Words("SORTTIME", doing or ("Drawing" if status == "busy" else "Starting"))
    if status == "ready":
        on_device = translate("Ready on {device}").format(device=device)
        return Words("CHECKMARK", on_device if device else "Ready")
    return Words("CONSOLE", "Starts when it is needed")


def question_lines(plan: SetUpPlan, translate: Translate = str) -> tuple[str, ...]:
    """What somebody must know before agreeing to a set-up."""
    download, disk = size_in_words(plan.cost.download), size_in_words(plan.cost.disk)
    sources = f" {translate('and')} ".join(plan.sources)
    return (
        *wrapped(translate("Folder: {folder}").format(folder=plan.environment), LINE_CHARACTERS),
        *wrapped(translate("Made of: {python}").format(python=plan.base_python), LINE_CHARACTERS),
        translate("Download: about {size} from {sources}").format(size=download, sources=sources),
        translate("Disk: about {size} while it is set up").format(size=disk),
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


def _title(state: RuntimeState, translate: Translate = str) -> str:
    ready = translate("Ready: version {version} on {device}")
    titles = {
        UNKNOWN: "Not checked yet",
        CHECKING: "Checking the runtime",
        READY: ready.format(version=state.version, device=state.device),
        MISSING: "There is no runtime in this Python" if state.python else "No runtime yet",
        WRONG_VERSION: _versions(state, translate),
        BROKEN: "The runtime cannot start",
    }
    return titles[state.kind]


def _versions(state: RuntimeState, translate: Translate) -> str:
    needed = pe_runtime.__version__
    if state.version == needed:
        said = translate(
            "Wrong version: the runtime is another build of {version} than this add-on"
        )
    else:
        said = translate("Wrong version: the runtime is {version}, this add-on needs {needed}")
    return said.format(version=state.version, needed=needed)


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


def _whereabouts(state: RuntimeState, translate: Translate) -> str:
    said = translate(ORIGINS.get(state.origin, "Python: {python}"))
    return said.format(python=state.python, variable=VARIABLE)
