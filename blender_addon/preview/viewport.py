"""One viewport in Rendered shading: reads the scene, wants pictures, draws the best that it has.

Blender's data is read in `read` and `draw` only, which it calls on the main thread.
"""

import time
import weakref

import bpy
from bpy.app.translations import pgettext_iface as iface_

from pe_runtime.contract.errors import PlayableEnvironmentError

from ..worker.session import session
from .desk import Desk, Shown, Wish
from .drawing_thread import Drawer
from .looking import covered_bottom, is_covered, look
from .subject import Subject, read_subject
from .view_camera import Rect

UNSEEN_SECONDS = 3.0
"""A viewport that has not drawn its news for so long is gone or hidden."""
COVERED_MESSAGE = (
    "The camera's background picture covers the preview; switch it off in the camera's properties"
)
RENDERING_MESSAGE = "Rendering; the preview goes on afterwards"


class Viewport:
    """What belongs to one region in Rendered shading."""

    def __init__(self) -> None:
        self.desk = Desk()
        self.drawer = Drawer(self.desk, session)
        self.rendering = False
        self._subject: Subject | None = None
        self._reason = ""
        self._covered = False
        self._drawn: Shown | None = None
        self._drawn_words = ""
        self._news_since: float | None = None
        self._texture = None
        weakref.finalize(self, self.desk.close)

    def read(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Take in what has changed in the scene."""
        try:
            self._subject, self._reason = read_subject(depsgraph), ""
        except PlayableEnvironmentError as error:
            self._subject, self._reason = None, str(error)

    def draw(
        self,
        engine: bpy.types.RenderEngine,
        context: bpy.types.Context,
        depsgraph: bpy.types.Depsgraph,
    ) -> None:
        """Draw the picture that there is, and ask for the one that there should be."""
        from . import drawing  # without a window there is nothing that it could draw with

        scene, region = depsgraph.scene, context.region
        rect = self._look(engine, context, depsgraph)
        self._covered = is_covered(context, depsgraph)
        shown, words = self.desk.shown, self.words
        if rect is not None and shown is not None:
            if self._texture is None or self._drawn is not shown:
                self._texture = drawing.texture_of(shown.rgb)
            drawing.draw_texture(engine, scene, self._texture, rect, region.height)
        if words:
            scale, bottom = (
                context.preferences.system.ui_scale,
                covered_bottom(context.area, region),
            )
            drawing.draw_words(words, region.width, scale, bottom)
        self._drawn, self._drawn_words, self._news_since = shown, words, None

    @property
    def words(self) -> str:
        """What has to be said to whoever looks at it; empty where the picture says all."""
        if self._reason or self.desk.failure:
            return self._reason or self.desk.failure
        if self.rendering and self.desk.has_more:
            return RENDERING_MESSAGE
        if session.doing and self.desk.has_more:
            return f"{iface_(session.doing)}..."
        return COVERED_MESSAGE if self._covered else ""

    @property
    def has_news(self) -> bool:
        """Whether it would look different if it were drawn again."""
        return self.desk.shown is not self._drawn or self.words != self._drawn_words

    def note_news(self) -> None:
        """It is about to be drawn again; where that does not happen, nobody looks at it."""
        now = time.monotonic()
        if self._news_since is None:
            self._news_since = now
        elif now - self._news_since > UNSEEN_SECONDS:
            self.desk.want(None)

    def _look(
        self,
        engine: bpy.types.RenderEngine,
        context: bpy.types.Context,
        depsgraph: bpy.types.Depsgraph,
    ) -> Rect | None:
        """Want what the view shows now; the part of the region where it stands."""
        if self._subject is None:
            self.desk.want(None)
            return None
        try:
            found = look(context, depsgraph, self._subject.environment_from_world)
            self._reason = ""
        except PlayableEnvironmentError as error:
            found, self._reason = None, str(error)
        self.desk.want(None if found is None else self._wish(found, engine, depsgraph.scene))
        return None if found is None else found[0]

    def _wish(self, found: tuple, engine: bpy.types.RenderEngine, scene: bpy.types.Scene) -> Wish:
        rect, camera = found
        coarse = max(int(engine.get_preview_pixel_size(scene)), 1)
        size = max(rect.width // coarse, 1), max(rect.height // coarse, 1)
        return self._subject.seen_by(camera if coarse == 1 else camera.scaled(*size))
