"""Folders of strips and frames, relative to the .blend once it is saved."""

from pathlib import Path

import bpy

from .provenance import JOB_KEY


def make_relative(blend: str) -> int:
    """Write the folders of this add-on's strips relative to a saved .blend; main thread only.

    Blender itself takes care of paths that are relative already when a file goes elsewhere.

    Args:
        blend: Path of the saved file.

    Returns:
        How many strips were changed; those on another drive cannot be.
    """
    changed = 0
    for scene in bpy.data.scenes:
        for strip in scene.sequence_editor.strips_all if scene.sequence_editor else ():
            if JOB_KEY not in strip or strip.directory.startswith("//"):
                continue
            if Path(strip.directory).anchor == Path(blend).anchor:
                strip.directory = bpy.path.relpath(strip.directory, start=str(Path(blend).parent))
                changed += 1
    return changed
