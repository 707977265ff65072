"""What setting up the runtime would do: from what, with which Python, into which folder.

No `bpy` here, and nothing is done: the words of the question and the work read the same plan.
"""

import sys
import zipfile
from dataclasses import dataclass, field
from pathlib import Path

from pe_runtime.contract.errors import PlayableEnvironmentError

ENVIRONMENT = "environment"
"""The private environment's folder within the add-on's own."""
CPU, GPU = "CPU", "GPU"
PACKAGES, TORCH = "pypi.org", "download.pytorch.org"
GIGABYTE = 10**9
TORCH_INDEX = f"https://{TORCH}/whl/"
CUDA = "cu130"
"""The CUDA version with which the pinned torch is built for Windows."""
OLDEST_PYTHON, NEWEST_PYTHON = (3, 11), (3, 14)


class SetUpError(PlayableEnvironmentError):
    """The runtime cannot be set up; what was there before is untouched."""


@dataclass(frozen=True)
class Cost:
    """What a set-up takes, in bytes, as measured with the pinned versions.

    Attributes:
        download: What comes over the network.
        disk: What it occupies while it is built, the downloads included.
    """

    download: int
    disk: int


COSTS = {
    CPU: Cost(330 * 10**6, 1_800 * 10**6),
    GPU: Cost(1_500 * 10**6, 7 * GIGABYTE),
}


@dataclass(frozen=True)
class SetUpPlan:
    """One private runtime to be.

    Attributes:
        base_python: The Python that the environment is made of.
        wheel: The runtime, as the extension brings it.
        folder: The add-on's own folder; the environment is a folder in it.
        processor: CPU, or GPU for a torch that uses an NVIDIA card.
        system: The operating system as `sys.platform` names it.
        options: More options for pip.
    """

    base_python: str
    wheel: Path
    folder: Path
    processor: str = CPU
    system: str = sys.platform
    options: tuple[str, ...] = field(default=())

    @property
    def environment(self) -> Path:
        """Where the runtime will be."""
        return self.folder / ENVIRONMENT

    @property
    def cost(self) -> Cost:
        """What it takes; the builds of PyPI for other systems than Linux need no CUDA."""
        return COSTS[self.processor]

    @property
    def sources(self) -> tuple[str, ...]:
        """Hosts that the files come from."""
        return (PACKAGES, TORCH) if self.torch_build() else (PACKAGES,)

    def torch_build(self) -> str:
        """The folder of PyTorch's own index to take torch from; empty: PyPI's torch is right.

        PyPI's is for CUDA on Linux and for the CPU everywhere else.
        """
        if self.system == "linux" and self.processor == CPU:
            return "cpu"
        if self.system == "win32" and self.processor == GPU:
            return CUDA
        return ""

    def pip_arguments(self) -> list[str]:
        """What pip is asked for."""
        quiet = ["--no-input", "--disable-pip-version-check", "--progress-bar", "off"]
        # A source package would need a compiler, which an artist does not have.
        wanted = ["--only-binary", ":all:", *self.options, str(self.wheel)]
        build = self.torch_build()
        if build and "--no-index" not in self.options:
            wanted += ["--extra-index-url", TORCH_INDEX + build]
        if build:
            # Named, so that pip fails rather than brings gigabytes that nobody agreed to.
            wanted.append(f"torch=={pinned_torch(self.wheel)}+{build}")
        return ["install", "--no-warn-script-location", *quiet, *wanted]


def offers_choice(system: str = sys.platform) -> bool:
    """Whether CPU and GPU are different downloads on this system."""
    return system in ("linux", "win32")


def pinned_torch(wheel: Path) -> str:
    """The version of torch that a wheel of the runtime asks for.

    Raises:
        SetUpError: It asks for none, or it is no wheel.
    """
    try:
        with zipfile.ZipFile(wheel) as archive:
            about = next(name for name in archive.namelist() if name.endswith("/METADATA"))
            lines = archive.read(about).decode().splitlines()
    except (OSError, zipfile.BadZipFile, StopIteration) as error:
        raise SetUpError(f"{wheel} is no wheel of the runtime: {error}") from error
    needs = (line.removeprefix("Requires-Dist: torch==") for line in lines if "torch==" in line)
    version = next(needs, "")
    if not version:
        raise SetUpError(f"{wheel} does not say which torch it needs")
    return version


def bundled_wheel(addon: Path) -> Path | None:
    """The runtime that this copy of the add-on brings; None in a checkout."""
    return next(iter(sorted((addon / "runtime").glob("playable_environments-*.whl"))), None)


def base_python(executable: str, prefix: str, system: str = sys.platform) -> str:
    """A Python to make an environment of: this one's program, also where Blender runs it.

    Args:
        executable: `sys.executable`; some programs that embed Python name themselves there.
        prefix: `sys.base_prefix`, where the Python lies.
        system: The operating system as `sys.platform` names it.

    Returns:
        The path; empty if there is none.
    """
    if Path(executable).name.lower().startswith("python"):
        return executable
    if system == "win32":
        names = ("bin/python.exe", "python.exe")
    else:
        names = tuple(f"bin/python{suffix}" for suffix in _suffixes())
    found = (Path(prefix) / name for name in names)
    return next((str(path) for path in found if path.is_file()), "")


def _suffixes() -> tuple[str, ...]:
    return f"{sys.version_info.major}.{sys.version_info.minor}", "3", ""
