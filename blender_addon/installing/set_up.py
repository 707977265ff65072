"""Builds the private runtime beside the old one, which it replaces only when it works.

No `bpy` here. Whatever happens, no half-built folder stays, and the old runtime does.
"""

import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from ..worker.runtime_python import PRIVATE, RuntimePython, python_of
from .folder_lock import folder_lock
from .pip_progress import PipProgress
from .plan import ENVIRONMENT, GIGABYTE, NEWEST_PYTHON, OLDEST_PYTHON, SetUpError, SetUpPlan
from .processes import OnLine, Watch, run
from .runtime_state import READY, RuntimeState, check

OnStage = Callable[[str, float], None]
"""Called with what is being done, and the share of the whole that is done, in [0, 1]."""
ShouldStop = Callable[[], bool]
BUILDING, REMOVING = "building-", "removing-"
LOG = "set-up.log"
TELLING_LINES = 3
MADE, INSTALLED = 0.05, 0.95
"""Shares of the whole after the environment is made and after the packages are in."""
TRIES, PAUSE_SECONDS = 20, 0.25
"""For folders that a virus scanner or a process that has just been ended still holds."""
NO_ENSUREPIP = (
    "{python} cannot make environments, since its distribution packs that apart: install "
    "python3-venv of the same version (Debian, Ubuntu), or choose another Python"
)
VERSION = "import sys; print(sys.version_info[0], sys.version_info[1])"
NOT_INHERITED = dict.fromkeys(("PIP_TARGET", "PIP_PREFIX", "PIP_USER", "PIP_REQUIRE_VIRTUALENV"))


def set_up(
    plan: SetUpPlan,
    should_stop: ShouldStop,
    on_stage: OnStage,
    release: Callable[[], None] = lambda: None,
) -> RuntimeState:
    """Build a private runtime and put it in the place of the old one.

    Args:
        plan: What to build.
        should_stop: Asked now and then.
        on_stage: Told what is being done.
        release: Ends the programs that run in the old runtime, right before it goes.

    Returns:
        The state of the new runtime: READY.

    Raises:
        StoppedError: `should_stop` said so; all is as it was.
        SetUpError: It did not work; all is as it was, and `LOG` in the folder has the whole story.
    """
    log: list[str] = []
    try:
        with folder_lock(plan.folder):
            _sweep(plan.folder)
            _check_room(plan)
            try:
                with _own_folder(plan.folder, BUILDING) as place:
                    made = _Build(plan, place, should_stop, on_stage, log).all()
                    release()
                    _replace(place / ENVIRONMENT, plan.environment)
            finally:
                _keep_log(plan.folder, log)
    except OSError as error:
        raise SetUpError(f"the runtime cannot be set up: {error}") from error
    return replace(made, python=str(python_of(plan.environment)))


def remove(folder: Path) -> None:
    """Remove the private runtime, and whatever a crash may have left of an earlier set-up.

    Raises:
        SetUpError: It is in use, or the folder cannot be written to.
    """
    try:
        with folder_lock(folder):
            _sweep(folder)
            if (folder / ENVIRONMENT).exists():
                # Away at once, so that nobody finds a runtime of which half is gone.
                gone = folder / f"{REMOVING}{time.time_ns()}"
                _retry(lambda: (folder / ENVIRONMENT).rename(gone))
                _delete(gone)
    except OSError as error:
        raise SetUpError(f"the runtime cannot be removed: {error}") from error


@dataclass
class _Build:
    """One environment under way, in a place of its own."""

    plan: SetUpPlan
    place: Path
    should_stop: ShouldStop
    on_stage: OnStage
    log: list[str] = field(default_factory=list)

    def all(self) -> RuntimeState:
        """Make the environment, fill it and prove it."""
        self.on_stage("Making an environment", 0.0)
        self._check_base()
        environment = self.place / ENVIRONMENT
        making = [self.plan.base_python, "-I", "-X", "utf8", "-m", "venv", str(environment)]
        try:
            self._run(making, "making the environment")
        except SetUpError as error:
            if any("ensurepip" in line for line in self.log):
                # What Debian says takes six lines, of which the fourth is the one to read.
                raise SetUpError(NO_ENSUREPIP.format(python=self.plan.base_python)) from error
            raise
        self._install(environment)
        shutil.rmtree(self._downloads)
        self.on_stage("Starting the runtime", INSTALLED)
        python = RuntimePython(str(python_of(environment)), PRIVATE)
        state = check(python, should_stop=self.should_stop)
        if state.kind != READY:
            raise SetUpError(f"the new runtime does not work: {state.reason or state.kind}")
        self.on_stage("Putting it in place", 1.0)
        return state

    def _check_base(self) -> None:
        """See that the Python is one for which there are packages.

        Raises:
            SetUpError: It is not.
        """
        said: list[str] = []
        command = [self.plan.base_python, "-I", "-c", VERSION]
        self._run(command, "starting Python", on_line=said.append)
        try:
            version = tuple(int(number) for number in said[-1].split())
        except (IndexError, ValueError):
            version = ()
        if len(version) != 2 or not OLDEST_PYTHON <= version <= NEWEST_PYTHON:
            found = ".".join(map(str, version)) or f"none: it says {' '.join(said)[:200]!r}"
            raise SetUpError(
                f"{self.plan.base_python}: expected a Python {OLDEST_PYTHON[0]}.{OLDEST_PYTHON[1]} "
                f"to {NEWEST_PYTHON[0]}.{NEWEST_PYTHON[1]}, found {found}; choose another one"
            )

    def _install(self, environment: Path) -> None:
        python = str(python_of(environment))
        command = [python, "-I", "-X", "utf8", "-u", "-m", "pip", *self.plan.pip_arguments()]
        progress = PipProgress(
            self._downloads, lambda: _site_packages(environment), self.plan.cost.download
        )

        def tell() -> None:
            self.on_stage(progress.stage, MADE + (INSTALLED - MADE) * progress.share)

        def note(line: str) -> None:
            self.log.append(line)
            progress.note_line(line)
            # A small package is in before the next tick.
            tell()

        def tick() -> None:
            progress.look()
            tell()

        self._run(command, "installing the packages", note, tick)

    @property
    def _downloads(self) -> Path:
        folder = self.place / "downloads"
        folder.mkdir(exist_ok=True)
        return folder

    def _run(
        self,
        command: Sequence[str],
        what: str,
        on_line: OnLine | None = None,
        on_tick: Callable[[], None] = lambda: None,
    ) -> None:
        """Run a program of the set-up; what it says goes to the log."""
        self.log.append("$ " + " ".join(command))
        temporary = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(self._downloads))
        watch = Watch(self.should_stop, on_line or self.log.append, on_tick)
        try:
            code = run(command, watch, NOT_INHERITED | temporary)
        except OSError as error:
            raise SetUpError(f"{what} failed: {command[0]!r} cannot start: {error}") from error
        if code != 0:
            raise SetUpError(f"{what} failed (exit code {code}): {telling_lines(self.log)}")


def _site_packages(environment: Path) -> Path | None:
    found = (environment.glob(each) for each in ("lib/*/site-packages", "Lib/site-packages"))
    return next((path for paths in found for path in paths), None)


def telling_lines(log: Sequence[str]) -> str:
    """What to read of a log first: its errors, or else its end."""
    said = [line.strip() for line in log if line.strip() and not line.startswith("$ ")]
    errors = [line for line in said if line.lower().startswith("error")]
    return " / ".join((errors or said)[-TELLING_LINES:]) or "it said nothing"


def _check_room(plan: SetUpPlan) -> None:
    free = shutil.disk_usage(plan.folder).free
    if free < plan.cost.disk:
        raise SetUpError(
            f"{plan.folder}: setting up the runtime takes about {plan.cost.disk / GIGABYTE:.1f} "
            f"GB of disk, {free / GIGABYTE:.1f} GB are free; make room there first"
        )


@contextmanager
def _own_folder(parent: Path, prefix: str) -> Iterator[Path]:
    """A new folder that is gone afterwards."""
    folder = Path(tempfile.mkdtemp(prefix=prefix, dir=parent))
    try:
        yield folder
    finally:
        _delete(folder)


def _replace(new: Path, final: Path) -> None:
    """Put a folder in its place; should that fail, the old one comes back."""
    old = final.with_name(f"{REMOVING}{time.time_ns()}")
    had_one = final.exists()
    if had_one:
        _retry(lambda: final.rename(old))
    try:
        _retry(lambda: new.rename(final))
    except OSError:
        if had_one:
            old.rename(final)
        raise
    if had_one:
        _delete(old)


def _sweep(folder: Path) -> None:
    """Delete what a killed Blender left; nobody works here while we hold the lock."""
    for prefix in (BUILDING, REMOVING):
        for left in folder.glob(f"{prefix}*"):
            _delete(left)


def _delete(folder: Path) -> None:
    _retry(lambda: shutil.rmtree(folder) if folder.exists() else None)


def _retry(act: Callable[[], object]) -> None:
    for left in reversed(range(TRIES)):
        try:
            act()
        except OSError:
            if not left:
                raise
            time.sleep(PAUSE_SECONDS)
        else:
            return


def _keep_log(folder: Path, log: Sequence[str]) -> None:
    (folder / LOG).write_text("\n".join(log) + "\n", encoding="utf-8")
