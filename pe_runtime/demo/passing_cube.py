"""The example of compositing: a cube of Blender's own passes between two players of a picture."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pe_runtime.demo.contact_sheet import Cell, write_contact_sheet
from pe_runtime.demo.film import FRAMES, DemoOptions, film_in_blender, spec_of
from pe_runtime.environment import MODELS
from pe_runtime.shots.clips import start_from_clip

PROGRAM = ("-m", "blender_addon.examples.passing_cube")
SIZE = (512, 288)
SHOWN = (9, 13, 16)
"""Frames of the sheet: behind the one player, between them, before the other."""


def run_passing_cube(
    out: str | Path,
    options: DemoOptions,
    on_progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[str, Any]:
    """Make the example in a folder; returns what lies where.

    Args:
        out: Gets spec.json, before/, after/, passing_cube.blend, contact_sheet.png.
        options: What is filmed, and how; players only raise their arms.
        on_progress: Called with frames drawn and their number while Blender renders.

    Raises:
        DemoError: Blender is missing or failed.
        PlayableEnvironmentError: The clip or the model is at fault.
    """
    out = Path(out).resolve()
    out.mkdir(parents=True, exist_ok=True)
    for old in out.glob("*/frame_*.png"):
        old.unlink()
    start = start_from_clip(options.clip or MODELS / "duel_clip")
    spec = spec_of(out, options, start, {}) | {"camera_move": {}}
    spec |= dict(zip(("width", "height"), options.size or SIZE, strict=True))
    (out / "spec.json").write_text(json.dumps(spec, indent=1))
    made = film_in_blender(out, PROGRAM, on_progress)
    sheet = out / "contact_sheet.png"
    cells = [
        Cell(Path(made[kind][frame - 1]), title, f"frame {frame}")
        for kind, title in (("before", "the players"), ("after", "with the cube"))
        for frame in SHOWN
    ]
    write_contact_sheet(cells, sheet)
    return made | {"contact_sheet": str(sheet), "frames": FRAMES}
