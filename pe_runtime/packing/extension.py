"""The extension: the add-on, the contract that it imports, and the runtime to set up."""

import tomllib
from pathlib import Path

from pe_runtime.packing.archives import read_tree, zip_bytes
from pe_runtime.packing.content_checks import check_contents
from pe_runtime.packing.manifest_checks import MANIFEST, check_manifest
from pe_runtime.packing.wheels import RUNTIME, PackingError, contract_wheel, runtime_wheel

ADDON = RUNTIME.parent / "blender_addon"
LEFT_OUT = frozenset(("datagen", "examples"))
"""What belongs to a checkout with torch or a `bpy` wheel, and not into Blender."""


def extension_files(addon: Path = ADDON) -> dict[str, bytes]:
    """All files of the extension by their path in its zip, checked.

    Args:
        addon: The folder of the add-on's sources.

    Raises:
        PackingError: What is there makes no extension; it says all that is wrong.
    """
    if not (addon / MANIFEST).is_file():
        raise PackingError(
            f"{addon} has no {MANIFEST}; install playable-environments whole or use a checkout"
        )
    files = read_tree(addon, LEFT_OUT)
    contract, contract_data = contract_wheel()
    runtime, runtime_data = runtime_wheel()
    files[f"wheels/{contract}"] = contract_data
    # Not among `wheels`: Blender would install those into its own Python.
    files[f"runtime/{runtime}"] = runtime_data
    files[MANIFEST] = _naming_the_wheel(files[MANIFEST].decode(), contract, addon).encode()
    problems = [*check_manifest(files[MANIFEST].decode(), files), *check_contents(files)]
    if problems:
        raise PackingError("the extension is not right: " + "; ".join(problems))
    return files


def write_extension(folder: Path, addon: Path = ADDON) -> Path:
    """Write the extension's zip, all at once or not at all, and return its path."""
    files = extension_files(addon)
    facts = tomllib.loads(files[MANIFEST].decode())
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{facts['id']}-{facts['version']}.zip"
    unfinished = file.with_suffix(".part")
    unfinished.write_bytes(zip_bytes(files))
    unfinished.replace(file)
    return file


def _naming_the_wheel(text: str, wheel: str, addon: Path) -> str:
    """The manifest's text with the wheel in it."""
    try:
        known = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise PackingError(f"{addon / MANIFEST} is no TOML: {error}") from error
    if "wheels" in known:
        raise PackingError(f"{addon / MANIFEST} must leave `wheels` to this command")
    # Before the first table: after it the key would belong to that table.
    head, bracket, rest = text.partition("\n[")
    return f'{head}\nwheels = ["./wheels/{wheel}"]\n{bracket}{rest}'
