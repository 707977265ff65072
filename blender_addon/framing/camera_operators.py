"""The camera of a picture: looked through, matched to ground points, fitted to the picture."""

import json
from functools import lru_cache

import bpy
from bpy.app.translations import pgettext_tip as tip_
from bpy.props import EnumProperty, IntProperty

from pe_runtime.contract.errors import PlayableEnvironmentError

from ..polls import allowed
from ..worker import questions
from ..worker.replies import MatchedCamera
from ..worker.session import session
from ..worker.worker_operator import Task, WorkerOperator, failed, model_path
from .backdrop import shown_size
from .cameras import has_shape, match_question, use_size
from .landmarks import FEWEST, GOOD_RESIDUAL, Place, landmarks
from .opening import note_match, show_picture_behind
from .picture_source import find_picture
from .readiness import edits_of
from .showing import look_through, show_picture


class PLAYABLE_OT_show_picture(bpy.types.Operator):
    """Look at the picture through its camera, so that it can be framed in the 3D view"""

    bl_idname = "playable.show_picture"
    bl_label = "Show Picture"
    bl_options = {"UNDO"}

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        framing = context.scene.playable_environment.framing
        if framing.facts is None and framing.camera_mode == "USUAL":
            # Where the usual camera stands, the model says; it calls back.
            bpy.ops.playable.load_model("INVOKE_DEFAULT", then="show_picture")
            return {"CANCELLED"}
        return self.execute(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            holder = show_picture(context.scene, edits_of(context))
        except PlayableEnvironmentError as error:
            return failed(self, error)
        if context.area is not None and context.area.type == "VIEW_3D":
            look_through(context, holder)
        return {"FINISHED"}


class PLAYABLE_OT_use_picture_size(bpy.types.Operator):
    """Render pictures of the framed picture's size, on square pixels"""

    bl_idname = "playable.use_picture_size"
    bl_label = "Use Picture Size"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        size = shown_size(context.scene)
        if not allowed(cls, size is not None, "Choose a picture and press Show Picture first"):
            return False
        return allowed(
            cls, not has_shape(context.scene.render, size), "The scene's frame has its shape"
        )

    def execute(self, context: bpy.types.Context) -> set[str]:
        use_size(context.scene.render, shown_size(context.scene))
        return {"FINISHED"}


class PLAYABLE_OT_match_camera(WorkerOperator, bpy.types.Operator):
    """Find the camera that sees the placed points of the ground where the picture shows them"""

    bl_idname = "playable.match_camera"
    bl_label = "Match Camera"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        placed = len(context.scene.playable_environment.framing.placed_points())
        said = tip_("Place {count} or more points of the ground first; there are {placed}")
        return allowed(cls, placed >= FEWEST, said.format(count=FEWEST, placed=placed))

    def task(self, context: bpy.types.Context) -> Task:
        name, scene = context.scene.name, context.scene
        model = model_path(scene.playable_environment.model)
        found = find_picture(scene, edits_of(context))
        points, focal = match_question(scene, found.size)

        def finish(matched: MatchedCamera) -> str:
            target = bpy.data.scenes[name]
            framing = target.playable_environment.framing
            framing.camera_mode, framing.is_open = "MATCH", True
            said = note_match(target, found.size, matched)
            show_picture_behind(target, framing.own_camera, found.keep().path)
            if matched.residual > GOOD_RESIDUAL:
                said += "; check the points with the largest residuals before you go on"
            return f"camera matched to {len(points)} points: {said}"

        def work(should_stop: object, _on_progress: object) -> MatchedCamera:
            return questions.match_camera(session, model, found.size, points, focal, should_stop)

        return Task(work, finish)


class PLAYABLE_OT_add_ground_point(bpy.types.Operator):
    """Add a point of the ground; place it on the picture with Place Points"""

    bl_idname = "playable.add_ground_point"
    bl_label = "Add Ground Point"
    bl_options = {"UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        framing = context.scene.playable_environment.framing
        framing.add_point()
        framing.is_open = True
        return {"FINISHED"}


class PLAYABLE_OT_remove_ground_point(bpy.types.Operator):
    """Take a point of the ground away"""

    bl_idname = "playable.remove_ground_point"
    bl_label = "Remove Ground Point"
    bl_options = {"UNDO"}

    index: IntProperty(
        name="Index", description="-1: the active point", default=-1, options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        framing = context.scene.playable_environment.framing
        return allowed(cls, len(framing.points) > 0, "There are no points")

    def execute(self, context: bpy.types.Context) -> set[str]:
        framing = context.scene.playable_environment.framing
        index = framing.active_point if self.index < 0 else self.index
        if not 0 <= index < len(framing.points):
            return failed(self, IndexError(f"there is no point {index + 1}"))
        framing.points.remove(index)
        framing.active_point = min(index, max(len(framing.points) - 1, 0))
        return {"FINISHED"}


def _landmark_items(_self: object, context: bpy.types.Context | None) -> tuple:
    if context is None:
        return ()
    return _items(tuple(known_landmarks(context.scene).items()))


@lru_cache(maxsize=8)
def _items(places: tuple[tuple[str, Place], ...]) -> tuple[tuple[str, str, str, int], ...]:
    # Cached for its references too: Blender does not keep the strings of dynamic items alive.
    return tuple(
        (name, f"{name} ({x:g}, {y:g})", f"x {x:g} m, y {y:g} m", number)
        for number, (name, (x, y)) in enumerate(places)
    )


class PLAYABLE_OT_use_landmark(bpy.types.Operator):
    """Give the active point the place of something that the model knows"""

    bl_idname = "playable.use_landmark"
    bl_label = "Known Place"
    bl_options = {"UNDO"}
    bl_property = "landmark"

    landmark: EnumProperty(
        name="Place", description="Corners of the model's static objects", items=_landmark_items
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        framing = context.scene.playable_environment.framing
        there = 0 <= framing.active_point < len(framing.points)
        if not allowed(cls, there, "Add a ground point first"):
            return False
        known = bool(known_landmarks(context.scene))
        return allowed(cls, known, "Load the model first; it knows places of its own")

    def execute(self, context: bpy.types.Context) -> set[str]:
        framing = context.scene.playable_environment.framing
        point = framing.points[framing.active_point]
        point.place = known_landmarks(context.scene)[self.landmark]
        point.name, framing.is_open = self.landmark, True
        return {"FINISHED"}


def known_landmarks(scene: bpy.types.Scene) -> dict[str, Place]:
    """The places that a scene's model knows; more of them once it has an environment."""
    settings = scene.playable_environment
    text = settings.state_text.as_string() if settings.state_text else ""
    return landmarks(settings.framing.facts, _static_positions(text))


@lru_cache(maxsize=4)
def _static_positions(text: str) -> dict[str, tuple[float, float, float]]:
    try:
        objects = json.loads(text)["state"]["objects"]
        return {name: tuple(each["position"]) for name, each in objects.items()}
    except (ValueError, TypeError, KeyError, AttributeError):
        return {}


CLASSES = (
    PLAYABLE_OT_show_picture,
    PLAYABLE_OT_use_picture_size,
    PLAYABLE_OT_match_camera,
    PLAYABLE_OT_add_ground_point,
    PLAYABLE_OT_remove_ground_point,
    PLAYABLE_OT_use_landmark,
)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
