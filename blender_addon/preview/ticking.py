"""A timer that runs while viewports have something to wait for, on the main thread."""

import weakref

import bpy

from ..polls import rendering
from ..windows import areas
from .viewport import Viewport

TICK_SECONDS = 0.05
RENDERING_TICK_SECONDS = 0.5
_viewports: weakref.WeakSet[Viewport] = weakref.WeakSet()


def viewport_of(engine: bpy.types.RenderEngine) -> Viewport:
    """The viewport that an engine of Blender's draws; engines of renders have none."""
    viewport = getattr(engine, "viewport", None)
    if viewport is None:
        engine.viewport = viewport = Viewport()
        _viewports.add(viewport)
    return viewport


def keep_ticking() -> None:
    """Have pictures drawn, and viewports draw them, until all is on show."""
    if not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=0.0)


def unregister() -> None:
    """Stop the timer and all that it keeps going."""
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    for viewport in list(_viewports):
        viewport.desk.close()
    _viewports.clear()


def _tick() -> float | None:
    renders = rendering()
    news = False
    for viewport in list(_viewports):
        viewport.rendering = renders
        if not renders:
            viewport.drawer.go_on()
        if viewport.has_news:
            viewport.note_news()
            news = True
    if news:
        _redraw()
    if not any(viewport.desk.has_more or viewport.has_news for viewport in _viewports):
        return None
    return RENDERING_TICK_SECONDS if renders else TICK_SECONDS


def _redraw() -> None:
    """Redraw the 3D views of all windows; an engine may be gone, they are asked anew."""
    for area in areas("VIEW_3D"):
        if area.spaces.active.shading.type == "RENDERED":
            area.tag_redraw()
