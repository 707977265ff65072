"""The runtime as wheels: its contract for Blender's Python, all of it for one with torch."""

import base64
import hashlib
from pathlib import Path

import pe_runtime
from pe_runtime.contract.errors import PlayableEnvironmentError
from pe_runtime.packing.archives import Contents, read_tree, zip_bytes

RUNTIME = Path(pe_runtime.__file__).parent
REQUIREMENTS = Path(__file__).with_name("requirements.txt")
KINDS = frozenset((".py", ".toml", ".md", ".json", ".png", ".npz", ".safetensors", ".txt"))
"""What the runtime consists of; a file of another kind was left behind by something else."""


class PackingError(PlayableEnvironmentError):
    """The extension cannot be built, or it would not do what it says."""


def contract_wheel() -> tuple[str, bytes]:
    """Name and bytes of a wheel with all that the add-on imports: the contract, pure Python."""
    contents = {
        f"pe_runtime/{name}": data
        for name, data in read_tree(RUNTIME).items()
        if name == "__init__.py" or (name.startswith("contract/") and name.endswith(".py"))
    }
    return wheel("playable-environments-contract", contents)


def runtime_wheel() -> tuple[str, bytes]:
    """Name and bytes of a wheel with the whole runtime, its models and its pinned requirements.

    Raises:
        PackingError: A file lies in the runtime that is no part of it.
    """
    contents = {f"pe_runtime/{name}": data for name, data in read_tree(RUNTIME).items()}
    foreign = [name for name in contents if not _belongs(name)]
    if foreign:
        raise PackingError(
            f"files in {RUNTIME} that are no part of the runtime: {', '.join(foreign)}; "
            "move them elsewhere"
        )
    return wheel("playable-environments", contents, requirements())


def requirements() -> tuple[str, ...]:
    """The pinned requirements of the whole runtime, one for each package and range of Pythons."""
    lines = (line.strip() for line in REQUIREMENTS.read_text().splitlines())
    return tuple(line for line in lines if line and not line.startswith("#"))


def wheel(
    name: str,
    contents: Contents,
    needs: tuple[str, ...] = (),
    version: str = pe_runtime.__version__,
) -> tuple[str, bytes]:
    """File name and bytes of a pure-Python wheel without scripts."""
    stem = f"{name.replace('-', '_')}-{version}"
    about = ["Metadata-Version: 2.1", f"Name: {name}", f"Version: {version}"]
    about += ["Requires-Python: >=3.11", *(f"Requires-Dist: {need}" for need in needs)]
    tags = ["Wheel-Version: 1.0", "Generator: pe", "Root-Is-Purelib: true", "Tag: py3-none-any"]
    files = dict(contents)
    files[f"{stem}.dist-info/METADATA"] = _lines(about)
    files[f"{stem}.dist-info/WHEEL"] = _lines(tags)
    record = [f"{path},sha256={_digest(data)},{len(data)}" for path, data in sorted(files.items())]
    files[f"{stem}.dist-info/RECORD"] = _lines([*record, f"{stem}.dist-info/RECORD,,"])
    return f"{stem}-py3-none-any.whl", zip_bytes(files)


def _belongs(name: str) -> bool:
    path = Path(name)
    return path.suffix in KINDS or path.name == "py.typed"


def _lines(lines: list[str]) -> bytes:
    return ("\n".join(lines) + "\n").encode()


def _digest(data: bytes) -> str:
    return base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
