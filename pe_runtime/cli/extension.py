"""`pe extension build`: the add-on as a Blender extension that brings the contract along."""

import base64
import hashlib
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from fnmatch import fnmatch
from pathlib import Path
from typing import Annotated

import typer

import pe_runtime
from pe_runtime.cli.terminal import shared, show
from pe_runtime.contract.errors import PlayableEnvironmentError

app = typer.Typer(help="The Blender add-on as an installable extension.")
RUNTIME = Path(pe_runtime.__file__).parent
ADDON = RUNTIME.parent / "blender_addon"
MANIFEST = "blender_manifest.toml"
BLENDERS_BUILDER = "bpy/*/scripts/addons_core/bl_pkg/cli/blender_ext.py"
LEFT_OUT = ("__pycache__", "*.pyc", "datagen", "demo_scene.py")
"""What belongs to a checkout with torch or a `bpy` wheel, and not into Blender."""


class ExtensionError(PlayableEnvironmentError):
    """The extension cannot be built, or Blender's own validation refuses it."""


@app.callback()
def extension() -> None:
    """Keep `build` a subcommand although it is the only one."""


@app.command()
@shared
def build(
    output: Annotated[Path, typer.Option("--out", "-o", help="Folder for the zip.")] = Path(),
) -> None:
    """Build the extension's zip; Blender installs it by drag and drop."""
    if not (ADDON / MANIFEST).is_file():
        raise ExtensionError(
            f"{ADDON} has no {MANIFEST}; install playable-environments whole or use a checkout"
        )
    output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        stage = _stage(Path(folder) / "extension")
        builder = find_builder()
        file = _build_with_blender(builder, stage, output) if builder else _zip(stage, output)
    show({"file": str(file), "bytes": file.stat().st_size, "validated": builder is not None})


def find_builder() -> Path | None:
    """Blender's own extension tool, out of an installed `bpy`."""
    found = (path for entry in sys.path for path in Path(entry).glob(BLENDERS_BUILDER))
    return next(found, None)


def write_contract_wheel(folder: Path) -> Path:
    """Write the pure-Python part of the runtime, all that the add-on imports, as a wheel."""
    version = pe_runtime.__version__
    name = f"playable_environments_contract-{version}"
    files = [RUNTIME / "__init__.py", *sorted((RUNTIME / "contract").glob("*.py"))]
    contents = {path.relative_to(RUNTIME.parent).as_posix(): path.read_bytes() for path in files}
    about = f"Metadata-Version: 2.1\nName: playable-environments-contract\nVersion: {version}\n"
    tags = "Wheel-Version: 1.0\nGenerator: pe\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
    contents[f"{name}.dist-info/METADATA"] = about.encode()
    contents[f"{name}.dist-info/WHEEL"] = tags.encode()
    record = [f"{path},sha256={_digest(data)},{len(data)}" for path, data in contents.items()]
    record.append(f"{name}.dist-info/RECORD,,")
    contents[f"{name}.dist-info/RECORD"] = ("\n".join(record) + "\n").encode()
    folder.mkdir(parents=True, exist_ok=True)
    wheel = folder / f"{name}-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, data in contents.items():
            # A fixed date: equal sources give an equal wheel.
            archive.writestr(zipfile.ZipInfo(path), data, zipfile.ZIP_DEFLATED)
    return wheel


def _stage(folder: Path) -> Path:
    """A copy of the add-on with the wheel in it and named in its manifest."""
    shutil.copytree(ADDON, folder, ignore=shutil.ignore_patterns(*LEFT_OUT))
    wheel = write_contract_wheel(folder / "wheels")
    manifest = folder / MANIFEST
    text = manifest.read_text()
    if "wheels" in tomllib.loads(text):
        raise ExtensionError(f"{ADDON / MANIFEST} must leave `wheels` to this command")
    # Before the first table: after it the key would belong to that table.
    head, bracket, rest = text.partition("\n[")
    manifest.write_text(f'{head}\nwheels = ["./wheels/{wheel.name}"]\n{bracket}{rest}')
    return folder


def _build_with_blender(builder: Path, stage: Path, output: Path) -> Path:
    before = set(output.glob("*.zip"))
    for arguments in (
        ["validate", str(stage)],
        ["build", "--source-dir", str(stage), "--output-dir", str(output)],
    ):
        done = subprocess.run([sys.executable, str(builder), *arguments], capture_output=True)
        if done.returncode != 0:
            said = (done.stdout + done.stderr).decode("utf-8", "replace").strip()
            raise ExtensionError(f"Blender's extension tool refuses to {arguments[0]}: {said}")
    facts = tomllib.loads((stage / MANIFEST).read_text())
    expected = output / f"{facts['id']}-{facts['version']}.zip"
    made = [expected] if expected.is_file() else sorted(set(output.glob("*.zip")) - before)
    if not made:
        raise ExtensionError(f"Blender's extension tool left no zip in {output}")
    return made[0]


def _zip(stage: Path, output: Path) -> Path:
    """What Blender's tool would make; used where no `bpy` is installed."""
    facts = tomllib.loads((stage / MANIFEST).read_text())
    file = output / f"{facts['id']}-{facts['version']}.zip"
    unfinished = file.with_suffix(".part")
    patterns = [each.strip("/") for each in facts.get("build", {}).get("paths_exclude_pattern", ())]
    with zipfile.ZipFile(unfinished, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(each for each in stage.rglob("*") if each.is_file()):
            parts = path.relative_to(stage).parts
            if not any(fnmatch(part, pattern) for part in parts for pattern in patterns):
                archive.write(path, "/".join(parts))
    unfinished.replace(file)
    return file


def _digest(data: bytes) -> str:
    return base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
