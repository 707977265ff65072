"""`pe extension build`: the add-on as a Blender extension that brings its runtime along."""

import subprocess
import sys
from pathlib import Path
from typing import Annotated

import typer

from pe_runtime.cli.terminal import shared, show
from pe_runtime.packing.extension import write_extension
from pe_runtime.packing.wheels import PackingError

app = typer.Typer(help="The Blender add-on as an installable extension.")
BLENDERS_TOOL = "bpy/*/scripts/addons_core/bl_pkg/cli/blender_ext.py"


@app.callback()
def extension() -> None:
    """Keep `build` a subcommand although it is the only one."""


@app.command()
@shared
def build(
    output: Annotated[Path, typer.Option("--out", "-o", help="Folder for the zip.")] = Path(),
) -> None:
    """Build the extension's zip; Blender installs it by drag and drop."""
    file = write_extension(output)
    tool = find_tool()
    if tool is not None:
        _validate(tool, file)
    show({"file": str(file), "bytes": file.stat().st_size, "validated": tool is not None})


def find_tool() -> Path | None:
    """Blender's own extension tool, out of an installed `bpy`."""
    found = (path for entry in sys.path for path in Path(entry).glob(BLENDERS_TOOL))
    return next(found, None)


def _validate(tool: Path, file: Path) -> None:
    """Have Blender's tool look at the zip too; what it refuses is not kept."""
    command = [sys.executable, str(tool), "validate", str(file)]
    done = subprocess.run(command, capture_output=True)
    if done.returncode != 0:
        file.unlink()
        said = (done.stdout + done.stderr).decode("utf-8", "replace").strip()
        raise PackingError(f"Blender's extension tool refuses the extension: {said}")
