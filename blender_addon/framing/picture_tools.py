"""Tools that work on the picture in a 3D view: drawing boxes, placing points of the ground.

What an event means is decided without Blender (`tool_events`); here it is only brought there and
back. Settings follow every move of the mouse, so that the overlay shows what is being drawn.
"""

import math

import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.props import FloatVectorProperty, IntProperty, StringProperty

from pe_runtime.contract.errors import PlayableEnvironmentError, ShotError

from ..polls import in_object_mode
from ..worker.worker_operator import failed
from .backdrop import shown_size
from .box_drawing import BoxDrawing
from .box_limits import inside
from .point_placing import PointPlacing
from .readiness import edits_of
from .showing import look_through, picture_in_view, show_picture
from .tool_events import CANCELLED, DONE, PASSED_ON, Tool, respond

REACH = 12.0
"""Region pixels within which a point is hit."""
STILL_PIXELS = 1e-3
"""Pixels of the picture below which a point has not been moved."""


class PictureTool:
    """Runs a Tool over the picture in the 3D view in which it is invoked."""

    def make_tool(self, scene: bpy.types.Scene, size: tuple[int, int]) -> Tool:
        """The tool, as the settings are now."""
        raise NotImplementedError

    def store(self, scene: bpy.types.Scene) -> None:
        """Put what the tool has into the settings."""
        raise NotImplementedError

    def put_back(self, scene: bpy.types.Scene) -> None:
        """Have the settings as they were before the tool."""
        raise NotImplementedError

    def hint(self) -> str:
        """What the artist can do now."""
        raise NotImplementedError

    def begin(self, context: bpy.types.Context) -> set[str]:
        """Show the picture and start; for `invoke`."""
        if context.area is None or context.area.type != "VIEW_3D":
            return failed(self, ShotError("open a 3D view and press the button in its sidebar"))
        scene = context.scene
        try:
            look_through(context, show_picture(scene, edits_of(context)))
        except PlayableEnvironmentError as error:
            return failed(self, error)
        # Names and numbers only: undo and file loading invalidate references.
        self._scene, self._size = scene.name, shown_size(scene)
        self._tool = self.make_tool(scene, self._size)
        context.window_manager.modal_handler_add(self)
        context.workspace.status_text_set(self.hint())
        context.window.cursor_modal_set("CROSSHAIR")
        context.area.tag_redraw()
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        scene, area = bpy.data.scenes.get(self._scene), context.area
        if scene is None or area is None or area.type != "VIEW_3D":
            return self._end(context, {"CANCELLED"})
        region = next(each for each in area.regions if each.type == "WINDOW")
        frame = picture_in_view(region, area.spaces.active, scene, self._size)
        if not self._tool.dragging and (frame is None or _elsewhere(area, event)):
            # Sidebars keep working, and so does the way back into the camera's view.
            leaving = event.type == "ESC" and event.value == "PRESS"
            return self._end(context, {"CANCELLED"}, scene) if leaving else {"PASS_THROUGH"}
        if frame is None:
            self._tool.let_go()
            return {"RUNNING_MODAL"}
        pixel = frame.to_picture(event.mouse_x - region.x, event.mouse_y - region.y)
        outcome = respond(self._tool, event.type, event.value, pixel, REACH / frame.zoom)
        if outcome == PASSED_ON:
            return {"PASS_THROUGH"}
        if outcome == CANCELLED:
            return self._end(context, {"CANCELLED"}, scene)
        self.store(scene)
        area.tag_redraw()
        context.workspace.status_text_set(self.hint())
        return self._end(context, {"FINISHED"}) if outcome == DONE else {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender ends the tool, as when its window is closed."""
        self._end(context, set())

    def _end(
        self,
        context: bpy.types.Context,
        result: set[str],
        restored: bpy.types.Scene | None = None,
    ) -> set[str]:
        if restored is not None:
            self.put_back(restored)
        if context.workspace is not None:
            context.workspace.status_text_set(None)
        if context.window is not None:
            context.window.cursor_modal_restore()
        if context.area is not None:
            context.area.tag_redraw()
        return result


class PLAYABLE_OT_draw_boxes(PictureTool, bpy.types.Operator):
    """Drag a box around each playable object in the picture, down to its feet"""

    bl_idname = "playable.draw_boxes"
    bl_label = "Draw Boxes"
    bl_options = {"UNDO"}

    object: StringProperty(
        name="Object", description="Draw only this one's; empty: all", options={"SKIP_SAVE"}
    )
    box: FloatVectorProperty(
        name="Box",
        description="Left, top, right, bottom in pixels, where nobody draws",
        size=4,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return in_object_mode(cls, context)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        settings = context.scene.playable_environment
        if settings.framing.facts is None or not settings.boxes:
            # Whose boxes there are, the model says; it calls back.
            bpy.ops.playable.load_model("INVOKE_DEFAULT", then="draw_boxes")
            return {"CANCELLED"}
        return self.begin(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        settings = scene.playable_environment
        try:
            if self.object not in settings.boxes:
                known = ", ".join(each.name for each in settings.boxes) or "none; load the model"
                raise ShotError(f"there is no object {self.object!r} to draw; there are {known}")
            show_picture(scene, edits_of(context))
            settings.boxes[self.object].box, note = inside(
                self.object, tuple(self.box), shown_size(scene)
            )
        except PlayableEnvironmentError as error:
            return failed(self, error)
        if note:
            self.report({"INFO"}, note)
        return {"FINISHED"}

    def make_tool(self, scene: bpy.types.Scene, size: tuple[int, int]) -> BoxDrawing:
        settings = scene.playable_environment
        self._before = settings.typed_boxes()
        names = [each.name for each in settings.boxes]
        names = [self.object] if self.object in names else names
        return BoxDrawing(names, self._before, size)

    def store(self, scene: bpy.types.Scene) -> None:
        _write_boxes(scene, self._tool.boxes)

    def put_back(self, scene: bpy.types.Scene) -> None:
        _write_boxes(scene, self._before)

    def hint(self) -> str:
        said = iface_(
            "{name}: drag a box around it, down to its feet · Tab: next · X: not in the picture · "
            "Enter: done · Esc: cancel"
        )
        return said.format(name=self._tool.current)


class PLAYABLE_OT_place_ground_points(PictureTool, bpy.types.Operator):
    """Click on the picture where it shows the points of the ground; drag them to correct them"""

    bl_idname = "playable.place_ground_points"
    bl_label = "Place Points"
    bl_options = {"UNDO"}

    index: IntProperty(
        name="Index", description="-1: a new point", default=-1, options={"SKIP_SAVE"}
    )
    pixel: FloatVectorProperty(
        name="Pixel", description="Where the picture shows it", size=2, options={"SKIP_SAVE"}
    )
    place: FloatVectorProperty(
        name="Ground",
        description="Where it lies on the ground, metres; as it is, if not given",
        size=2,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return in_object_mode(cls, context)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        return self.begin(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        framing = context.scene.playable_environment.framing
        if self.index >= len(framing.points):
            return failed(self, ShotError(f"there is no point {self.index}; -1 makes a new one"))
        point = framing.points[self.index] if self.index >= 0 else framing.add_point()
        point.pixel = self.pixel
        if self.properties.is_property_set("place"):
            point.place = self.place
        return {"FINISHED"}

    def make_tool(self, scene: bpy.types.Scene, size: tuple[int, int]) -> PointPlacing:
        framing = scene.playable_environment.framing
        self._before = [each.as_numbers() for each in framing.points]
        placed = [tuple(each.pixel) if each.is_placed else None for each in framing.points]
        return PointPlacing(placed, framing.active_point if placed else 0, size)

    def store(self, scene: bpy.types.Scene) -> None:
        framing, tool = scene.playable_environment.framing, self._tool
        if tool.sources != list(range(len(framing.points))):
            now = [each.as_numbers() for each in framing.points]
            _write_points(framing, [None if at is None else now[at] for at in tool.sources])
            tool.sources = list(range(len(framing.points)))
        for point, pixel in zip(framing.points, tool.points, strict=True):
            # Settings keep single precision: what comes back is never exactly what was stored.
            if pixel is not None and (
                not point.is_placed or math.dist(point.pixel, pixel) > STILL_PIXELS
            ):
                point.pixel = pixel
            point.is_placed = pixel is not None
        framing.active_point = min(tool.active, max(len(framing.points) - 1, 0))

    def put_back(self, scene: bpy.types.Scene) -> None:
        _write_points(scene.playable_environment.framing, self._before)

    def hint(self) -> str:
        said = iface_(
            "Point {number}: click where the picture shows it, drag to correct · Tab: next · "
            "X: remove · Enter: done · Esc: cancel"
        )
        return said.format(number=self._tool.active + 1)


def _elsewhere(area: bpy.types.Area, event: bpy.types.Event) -> bool:
    """Whether the mouse is on a sidebar or header that lies over the view, or beside the view."""
    for region in area.regions:
        inside_x = region.x <= event.mouse_x < region.x + region.width
        inside_y = region.y <= event.mouse_y < region.y + region.height
        if region.type != "WINDOW" and min(region.width, region.height) > 1:
            if inside_x and inside_y:
                return True
        elif region.type == "WINDOW" and not (inside_x and inside_y):
            return True
    return False


def _write_boxes(scene: bpy.types.Scene, boxes: dict[str, tuple]) -> None:
    for each in scene.playable_environment.boxes:
        wanted = boxes.get(each.name, (0.0, 0.0, 0.0, 0.0))
        if tuple(each.box) != tuple(wanted):
            each.box = wanted


def _write_points(framing: bpy.types.PropertyGroup, points: list[tuple | None]) -> None:
    framing.points.clear()
    for numbers in points:
        if numbers is None:
            framing.add_point()
        else:
            framing.points.add().take(numbers)
    framing.active_point = min(framing.active_point, max(len(points) - 1, 0))


CLASSES = (PLAYABLE_OT_draw_boxes, PLAYABLE_OT_place_ground_points)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
