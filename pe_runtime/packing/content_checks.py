"""Whether an extension holds all that it should, and nothing else."""

import io
import zipfile
from collections.abc import Iterator
from pathlib import PurePosixPath

from pe_runtime.packing.archives import Contents
from pe_runtime.packing.imports import missing_imports
from pe_runtime.packing.manifest_checks import MANIFEST

NEEDED = (MANIFEST, "__init__.py")
FOREIGN_FOLDERS = frozenset(("__pycache__", "tests", "datagen"))
KINDS = frozenset((".py", ".toml", ".whl", ".md", ".json", ".png", ".svg", ".blend"))


def check_contents(files: Contents) -> Iterator[str]:
    """What is missing from an extension's files, and what is foreign to them."""
    for name in NEEDED:
        if name not in files:
            yield f"{name} is missing"
    if not any(name.startswith("runtime/") for name in files):
        yield "runtime/ is empty: nothing could be set up from this extension"
    for name in sorted(files):
        path = PurePosixPath(name)
        if {*path.parts} & FOREIGN_FOLDERS or path.suffix not in KINDS:
            yield f"{name} is no part of the add-on; move it elsewhere"
    brought: dict[str, bytes] = {}
    for name in sorted(each for each in files if each.startswith("wheels/")):
        with zipfile.ZipFile(io.BytesIO(files[name])) as archive:
            brought |= {each: archive.read(each) for each in archive.namelist()}
    yield from missing_imports(files, brought)
