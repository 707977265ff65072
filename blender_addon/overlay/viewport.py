"""The overlay in Blender's 3D viewports: what is drawn when, and what is kept between redraws.

Viewports are redrawn many times a second, so lines are computed and handed to the graphics card
only when what they show has changed.
"""

from collections.abc import Callable
from contextlib import suppress

import bpy
from mathutils import Matrix

from pe_runtime.contract.errors import PlayableEnvironmentError

from ..scene_bridge import world_from_environment
from . import drawing
from .foreseen_paths import action_labels, path_lines, step_marks
from .ghosts import Skins, ghost_lines, heading_arrows, present_lines
from .picture_marks import box_lines, ground_lines, mark_lines, standing_lines
from .scene_lines import SceneLines, joined
from .scene_views import foresight_of, picture_view_of

PICTURE_PARTS = {
    "grid": ground_lines,
    "volumes": standing_lines,
    "boxes": box_lines,
    "points": mark_lines,
}
PLAYING_PARTS = {
    "players": present_lines,
    "paths": path_lines,
    "steps": step_marks,
    "actions": action_labels,
    "headings": heading_arrows,
}
MOST_KEPT = 64
"""Parts of scenes of which batches are kept."""
_kept: dict[tuple[str, str], tuple[object, drawing.Batches]] = {}
_handles: list[object] = []


def start(in_view: Callable[[], None], in_pixels: Callable[[], None]) -> None:
    """Have every 3D viewport call these from now on; only where there is a window.

    Args:
        in_view: Draws in the scene's space.
        in_pixels: Draws in pixels of the viewport.
    """
    add = bpy.types.SpaceView3D.draw_handler_add
    _handles.append(add(in_view, (), "WINDOW", "POST_VIEW"))
    _handles.append(add(in_pixels, (), "WINDOW", "POST_PIXEL"))


def stop() -> None:
    """Undo `start`."""
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")
    _kept.clear()


def draw_view(context: bpy.types.Context) -> None:
    """Draw lines and dots in the context's viewport."""
    for batches, world, scale in _shown(context):
        drawing.draw_lines(batches, context.region, world, scale)


def draw_pixels(context: bpy.types.Context) -> None:
    """Write names in the context's viewport."""
    labels, place = [], None
    for batches, world, scale in _shown(context):
        labels += batches.labels
        place = world, scale
    if labels:
        drawing.draw_labels(labels, context.region, context.region_data, *place)


def overlay_lines(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> SceneLines:
    """Everything that the overlay shows of a scene now, in environment space."""
    return joined(make() for _, _, make in _parts(scene, depsgraph))


def _parts(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> list[tuple]:
    """Per part that is switched on: its name, what it depends on, and what makes it."""
    overlay, parts = scene.playable_environment.overlay, []
    with suppress(PlayableEnvironmentError):
        if (view := picture_view_of(scene, depsgraph)) is not None:
            for name, make in PICTURE_PARTS.items():
                if getattr(overlay, name):
                    parts.append((name, view, lambda make=make, view=view: make(view)))
    with suppress(PlayableEnvironmentError):
        if (seen := foresight_of(scene)) is not None:
            for name, make in PLAYING_PARTS.items():
                if getattr(overlay, name):
                    parts.append((name, seen, lambda make=make, seen=seen: make(seen)))
            if overlay.ghosts:
                skins = Skins(overlay.ghosts_before, overlay.ghosts_after, overlay.ghost_steps)
                parts.append(("ghosts", (seen, skins), lambda: ghost_lines(seen, skins)))
    return parts


def _batches(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> list[drawing.Batches]:
    """What the graphics card holds of a scene's parts, made anew where they have changed."""
    found = []
    for name, signature, make in _parts(scene, depsgraph):
        known, batches = _kept.pop((scene.name, name), (None, None))
        if known is None or known != signature:
            batches = drawing.batches_of(make())
        # Put back at the end: the first ones are those that were not shown for the longest time.
        _kept[scene.name, name] = signature, batches
        found.append(batches)
    while len(_kept) > MOST_KEPT:
        del _kept[next(iter(_kept))]
    return found


def _shown(context: bpy.types.Context) -> list[tuple[drawing.Batches, Matrix, float]]:
    """What there is to draw in the context's viewport: batches, their space, and the UI's scale."""
    scene = context.scene
    if not (context.space_data.overlay.show_overlays and scene.playable_environment.overlay.show):
        return []
    depsgraph = context.view_layer.depsgraph
    batches = _batches(scene, depsgraph)
    if not batches:
        return []
    with suppress(PlayableEnvironmentError):
        world = Matrix(world_from_environment(depsgraph).tolist())
        scale = context.preferences.system.ui_scale
        return [(each, world, scale) for each in batches]
    return []
