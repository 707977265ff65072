"""Which Python has the runtime, by looking at paths alone. No `bpy` here, and nothing starts."""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import pe_runtime
from pe_runtime.contract.errors import WorkerError

VARIABLE = "PLAYABLE_ENVIRONMENTS_PYTHON"
"""Environment variable that names a Python with the runtime, for farms without preferences."""
CHOSEN, PRIVATE, OWN = "preferences", "private", "own"
NO_RUNTIME = (
    "no runtime is set up; in the add-on's preferences press Set Up Runtime, or name there a "
    "Python that has playable-environments installed. Without a window: set the environment "
    f"variable {VARIABLE} to such a Python"
)


@dataclass(frozen=True)
class Places:
    """Where the runtime may be.

    Attributes:
        chosen: Python that the preferences name; empty: none.
        private: Folder of the environment that the add-on sets up itself.
        own: The Python that runs this, where that is a Python and not Blender's own.
    """

    chosen: str = ""
    private: Path | None = None
    own: str = ""


@dataclass(frozen=True)
class RuntimePython:
    """A Python that should have the runtime, and who says so: VARIABLE, CHOSEN, PRIVATE or OWN."""

    python: str
    origin: str


def find_python(places: Places, environment: Mapping[str, str]) -> RuntimePython | None:
    """The Python to use: the farm's word first, then the artist's, then ours; None without one."""
    if environment.get(VARIABLE):
        return RuntimePython(environment[VARIABLE], VARIABLE)
    if places.chosen:
        return RuntimePython(places.chosen, CHOSEN)
    if places.private is not None and (places.private / "pyvenv.cfg").is_file():
        return RuntimePython(str(python_of(places.private)), PRIVATE)
    if places.own and _is_whole():
        return RuntimePython(places.own, OWN)
    return None


def wanted_python(places: Places, environment: Mapping[str, str]) -> RuntimePython:
    """As `find_python`.

    Raises:
        WorkerError: There is none; it says what to do.
    """
    found = find_python(places, environment)
    if found is None:
        raise WorkerError(NO_RUNTIME)
    return found


def python_of(environment: Path) -> Path:
    """The Python of a virtual environment."""
    inside = ("Scripts", "python.exe") if sys.platform == "win32" else ("bin", "python")
    return environment.joinpath(*inside)


def own_python(blender_binary: str) -> str:
    """The Python that runs this, unless it belongs to a Blender with this binary."""
    return "" if blender_binary else sys.executable


def _is_whole() -> bool:
    """Whether this Python has more of the runtime than the contract that the extension brings."""
    return (Path(pe_runtime.__file__).parent / "worker").is_dir()
