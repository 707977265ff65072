"""Opening a picture: its model is loaded, its objects are found and get their Empties."""

from collections.abc import Callable
from contextlib import suppress

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.model_facts import ModelFacts

from ..polls import allowed, in_object_mode, not_rendering
from ..usual_camera import usual_camera
from ..worker import questions
from ..worker.session import session
from ..worker.worker_operator import Task, WorkerOperator, model_path
from .cameras import environment_matrix, scene_camera, seen_by
from .opening import (
    Opening,
    boxes_from_json,
    check_names,
    finish_opening,
    new_scene_like,
    note_match,
    open_picture,
)
from .picture_source import find_picture
from .readiness import edits_of, missing

ONCE = {"SKIP_SAVE"}


class NewEnvironment(WorkerOperator):
    """Encodes a picture and puts an Empty where each of its playable objects stands."""

    image: StringProperty(name="Picture", description="Empty: the scene's setting", options=ONCE)
    model: StringProperty(name="Model", description="Empty: the scene's setting", options=ONCE)
    boxes: StringProperty(
        name="Boxes",
        description='Empty: the scene\'s setting. JSON: {"player_1": [left, top, right, bottom]}',
        options=ONCE,
    )
    camera: EnumProperty(
        name="Camera",
        description="Which camera saw the picture",
        items=(
            ("SCENE", "Scene Camera", "The scene's camera, which must match the picture"),
            ("USUAL", "Usual Camera", "Make a camera where such pictures are usually taken from"),
            ("MATCH", "Matched Camera", "Make the camera that sees the placed ground points"),
        ),
        options=ONCE,
    )
    new_scene: BoolProperty(
        name="New Scene",
        description="Leave this scene as it is and make the environment in a new one",
        options=ONCE,
    )

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.follow_setting(context.scene)
        return super().invoke(context, event)

    def follow_setting(self, scene: bpy.types.Scene) -> None:
        """Unless a camera was asked for, take what the panel says."""
        if not self.properties.is_property_set("camera"):
            self.camera = scene.playable_environment.framing.camera_mode

    def task(self, context: bpy.types.Context) -> Task:
        scene, name, as_new = context.scene, context.scene.name, self.new_scene
        settings = scene.playable_environment
        model = model_path(self.model or settings.model)
        found = find_picture(scene, edits_of(context), self.image)
        boxes = boxes_from_json(self.boxes) if self.boxes else settings.typed_boxes()
        camera = _camera_of_scene(context, found.size) if self.camera == "SCENE" else None
        mode = "USUAL" if self.camera == "SCENE" and camera is None else self.camera
        opening = open_picture(scene, model, found, boxes, (mode, camera))

        def finish(encoded: tuple) -> str:
            made = bpy.data.scenes[name]
            if as_new:
                made = new_scene_like(made)
                if context.window:
                    context.window.scene = made
            facts, eye, state, matched = encoded
            if matched is not None:
                note_match(made, found.size, matched)
            return finish_opening(made, opening, facts, eye, state)

        return Task(_encoding(opening), finish)


class PLAYABLE_OT_new_environment(NewEnvironment, bpy.types.Operator):
    """Encode a picture and put an Empty where each of its playable objects stands"""

    bl_idname = "playable.new_environment"
    bl_label = "New Playable Environment"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return in_object_mode(cls, context)


class PLAYABLE_OT_open_picture(NewEnvironment, bpy.types.Operator):
    """Encode the picture as it is set up here; each playable object gets its Empty"""

    bl_idname = "playable.open_picture"
    bl_label = "New Playable Environment"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not in_object_mode(cls, context):
            return False
        lacking = missing(context.scene, edits_of(context))
        if not allowed(cls, lacking is None, lacking.text if lacking else ""):
            return False
        return not_rendering(cls)

    def execute(self, context: bpy.types.Context) -> set[str]:
        self.follow_setting(context.scene)
        return super().execute(context)


class PLAYABLE_OT_load_model(WorkerOperator, bpy.types.Operator):
    """Load the model and list its playable objects, so that their boxes can be drawn"""

    bl_idname = "playable.load_model"
    bl_label = "Load Model"
    bl_options = {"UNDO"}

    then: StringProperty(
        name="Then", description="An operator that waits for it", options={"HIDDEN", "SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, bool(context.scene.playable_environment.model), "Choose a model file")

    def task(self, context: bpy.types.Context) -> Task:
        name = context.scene.name
        model = model_path(context.scene.playable_environment.model)

        def finish(facts: ModelFacts) -> str:
            settings = bpy.data.scenes[name].playable_environment
            settings.list_boxes(facts.playable_names)
            settings.note_facts(facts)
            terms = f"; weights: {facts.licence}" if facts.licence else ""
            players = ", ".join(facts.playable_names) or "nothing"
            return f"{facts.name}: {players} can be played{terms}"

        return Task(lambda should_stop, _: session.facts(model, should_stop), finish)

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        result = super().modal(context, event)
        if result == {"FINISHED"} and self.then:
            # A file may have been opened meanwhile; then nobody waits any more.
            with suppress(RuntimeError):
                getattr(bpy.ops.playable, self.then)("INVOKE_DEFAULT")
        return result


def _encoding(opening: Opening) -> Callable:
    """What the worker has to do for a picture; its result is facts, camera, state and match."""

    def work(should_stop: Callable, on_progress: Callable) -> tuple:
        on_progress("loading the model", 0, 3)
        facts = session.facts(opening.model, should_stop)
        check_names(opening.boxes, facts.playable_names)
        size, eye, matched = opening.found.size, opening.eye, None
        if opening.question is not None:
            on_progress("matching the camera", 1, 3)
            points, focal = opening.question
            matched = questions.match_camera(
                session, opening.model, size, points, focal, should_stop
            )
            eye = matched.camera
        eye = eye or usual_camera(facts, *size)
        on_progress("encoding", 2, 3)
        state = session.encode(opening.model, opening.found.pixels, eye, opening.boxes, should_stop)
        return facts, eye, state, matched

    return work


def _camera_of_scene(context: bpy.types.Context, size: tuple[int, int]) -> Camera | None:
    holder = scene_camera(context.scene)
    if holder is None:
        return None
    context.view_layer.update()
    evaluated = holder.evaluated_get(context.evaluated_depsgraph_get())
    matrix = environment_matrix(context.scene)
    return seen_by(evaluated, context.scene.render, matrix, size)


CLASSES = (PLAYABLE_OT_load_model, PLAYABLE_OT_new_environment, PLAYABLE_OT_open_picture)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
