"""What a user can press. Context is read here and in the panels, nowhere else."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path

import bpy
from bpy.props import EnumProperty, StringProperty

from pe_runtime.contract.errors import PlayableEnvironmentError, ShotError
from pe_runtime.contract.model_facts import ModelFacts

from . import playables
from .keyed_paths import write_bake
from .pictures import read_picture
from .playables import Picture
from .range_render import (
    RenderWatch,
    borrow_settings,
    job_for,
    lent_settings,
    show_in_sequencer,
)
from .replies import PredictedPaths
from .scene_bridge import (
    action_names,
    read_camera,
    sample_range,
    shot_from_moments,
    world_from_environment,
)
from .session import session
from .settings import action_items
from .usual_camera import add_camera, usual_camera
from .volumes import farthest
from .worker_operator import (
    Result,
    Task,
    WorkerOperator,
    end_modal,
    failed,
    show_progress,
    start_modal,
)


class PLAYABLE_OT_new_environment(WorkerOperator, bpy.types.Operator):
    """Encode a picture and put an Empty where each of its playable objects stands."""

    bl_idname = "playable.new_environment"
    bl_label = "New Playable Environment"
    bl_options = {"UNDO"}

    image: StringProperty(name="Picture", description="Empty: the scene's setting")
    model: StringProperty(name="Model", description="Empty: the scene's setting")
    boxes: StringProperty(
        name="Boxes",
        description='Empty: the scene\'s setting. JSON: {"player_1": [left, top, right, bottom]}',
    )
    camera: EnumProperty(
        name="Camera",
        description="Which camera saw the picture",
        items=(
            ("SCENE", "Scene Camera", "The scene's camera, which must match the picture"),
            ("USUAL", "Usual Camera", "Make a camera where such pictures are usually taken from"),
        ),
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _allowed(cls, context.mode == "OBJECT", "Leave edit or pose mode first")

    def task(self, context: bpy.types.Context) -> Task:
        scene = context.scene
        settings = scene.playable_environment
        model = _model_path(self.model or settings.model)
        path = str(Path(bpy.path.abspath(self.image or settings.image_path)).resolve())
        boxes = _boxes_from_json(self.boxes) if self.boxes else settings.typed_boxes()
        pixels = read_picture(path)
        size, name = (pixels.shape[1], pixels.shape[0]), scene.name
        eye = None
        if self.camera == "SCENE" and scene.camera is not None:
            context.view_layer.update()
            eye = read_camera(context.evaluated_depsgraph_get(), size)

        def work(_should_stop: object, on_progress: Callable) -> tuple:
            on_progress("starting", 0, 2)
            facts = session.facts(model)
            _check_names(boxes, facts.playable_names)
            picture = Picture(path, eye or usual_camera(facts, *size), boxes)
            on_progress("encoding", 1, 2)
            return facts, picture, session.encode(model, pixels, picture.camera, boxes)

        def finish(found: tuple) -> str:
            playables.build_environment(bpy.data.scenes[name], model, *found)
            if eye is None:
                _add_usual_camera(bpy.data.scenes[name], *found)
            terms = f"; weights: {found[0].licence}" if found[0].licence else ""
            return f"{len(boxes)} playable objects found; colours are set to Standard{terms}"

        return Task(work, finish)


class PLAYABLE_OT_load_model(WorkerOperator, bpy.types.Operator):
    """Load the model and list its playable objects, so that their boxes can be typed."""

    bl_idname = "playable.load_model"
    bl_label = "Load Model"
    bl_options = {"UNDO"}

    def task(self, context: bpy.types.Context) -> Task:
        name = context.scene.name
        model = _model_path(context.scene.playable_environment.model)

        def finish(facts: ModelFacts) -> str:
            settings = bpy.data.scenes[name].playable_environment
            settings.list_boxes(facts.playable_names)
            settings.note_facts(facts)
            terms = f"; weights: {facts.licence}" if facts.licence else ""
            players = ", ".join(facts.playable_names) or "nothing"
            return f"{facts.name}: {players} can be played{terms}"

        return Task(lambda *_: session.facts(model), finish)


class PLAYABLE_OT_bake_paths(WorkerOperator, bpy.types.Operator):
    """Let the model act out the action keys, seen by the animated camera, and key the paths."""

    bl_idname = "playable.bake_paths"
    bl_label = "Bake Paths"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        root = context.scene.playable_environment.root
        return _allowed(cls, root is not None, "Make a New Playable Environment first")

    def task(self, context: bpy.types.Context) -> Task:
        scene = context.scene
        name, settings = scene.name, scene.playable_environment
        start = playables.stored_start(settings)
        moments = sample_range(scene, range(scene.frame_start, scene.frame_end + 1))
        shot = shot_from_moments(scene, start, _model_path(settings.model), moments)

        def finish(paths: PredictedPaths) -> str:
            write_bake(bpy.data.scenes[name], shot, paths, moments)
            return f"Baked {len(shot.objects)} paths over {len(moments)} frames"

        return Task(lambda stop, progress: session.rollout(shot, stop, progress), finish)


class PLAYABLE_OT_insert_action_key(bpy.types.Operator):
    """Let the active playable object do an action from this frame to its next key."""

    bl_idname = "playable.insert_action_key"
    bl_label = "Insert Action Key"
    bl_options = {"REGISTER", "UNDO"}

    action: EnumProperty(
        name="Action",
        description="What the object does from this frame on",
        items=lambda _self, context: action_items(_names_in(context)),
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        chosen = context.object is not None and context.object.playable.is_playable
        if not _allowed(cls, chosen, "Select a playable Empty first"):
            return False
        return _allowed(cls, bool(action_names(context.object)), "The model has no actions for it")

    def execute(self, context: bpy.types.Context) -> Result:
        action = int(self.action.removeprefix("A"))
        try:
            playables.key_action(context.object, context.scene.frame_current, action)
        except PlayableEnvironmentError as error:
            return failed(self, error)
        return {"FINISHED"}


class PLAYABLE_OT_render_to_sequencer(bpy.types.Operator):
    """Render the frame range and show it as one strip in the sequencer of the Edit scene."""

    bl_idname = "playable.render_to_sequencer"
    bl_label = "Render to Sequencer"
    bl_options = {"UNDO"}

    folder: StringProperty(name="Folder", description="Empty: the scene's setting")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        baked = context.scene.playable_environment.bake_text is not None
        return _allowed(cls, baked, "Bake paths first")

    def execute(self, context: bpy.types.Context) -> Result:
        scene = context.scene
        try:
            job = job_for(scene, self.folder or scene.playable_environment.frames_folder)
            with lent_settings(scene, job):
                bpy.ops.render.render(animation=True, scene=scene.name)
            strip = show_in_sequencer(scene, job)
        except (PlayableEnvironmentError, RuntimeError) as error:
            return failed(self, error)
        self.report({"INFO"}, f"{len(job.files)} frames in strip {strip.name!r}")
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        scene = context.scene
        try:
            self._job = job_for(scene, self.folder or scene.playable_environment.frames_folder)
        except PlayableEnvironmentError as error:
            return failed(self, error)
        take, self._give_back = borrow_settings(scene, self._job)
        take()
        self._watch = RenderWatch()
        start_modal(self, context)
        bpy.ops.render.render("INVOKE_DEFAULT", animation=True, scene=scene.name)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if event.type != "TIMER":
            return {"PASS_THROUGH"}  # Esc too: Blender's own render job listens for it
        watch, count = self._watch, len(self._job.files)
        show_progress(context, f"Rendering {watch.written} of {count}", watch.written / count)
        if not watch.ended or bpy.app.is_job_running("RENDER"):
            return {"RUNNING_MODAL"}
        end_modal(self, context)
        watch.close()
        self._give_back()
        if watch.cancelled:
            self.report({"WARNING"}, "Rendering stopped; the strip is as it was")
            return {"CANCELLED"}
        try:
            show_in_sequencer(bpy.data.scenes[self._job.scene_name], self._job)
        except PlayableEnvironmentError as error:
            return failed(self, error)
        _show_edit_scene(context, bpy.data.scenes[self._job.scene_name])
        return {"FINISHED"}


class PLAYABLE_OT_stop_worker(bpy.types.Operator):
    """End the worker process; the next request starts another."""

    bl_idname = "playable.stop_worker"
    bl_label = "Stop Worker"

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        return _allowed(cls, session.worker_pid is not None, "No worker is running")

    def execute(self, _context: bpy.types.Context) -> Result:
        session.close()
        return {"FINISHED"}


def _allowed(operator: type, condition: bool, why_not: str) -> bool:
    if not condition:
        operator.poll_message_set(why_not)
    return condition


def _add_usual_camera(
    scene: bpy.types.Scene, facts: ModelFacts, picture: Picture, state: Mapping
) -> None:
    layer = scene.view_layers[0]
    layer.update()
    root, eye = world_from_environment(layer.depsgraph), picture.camera
    add_camera(scene, eye, root, farthest(facts, state, eye.world_from_camera[:3, 3]))


def _show_edit_scene(context: bpy.types.Context, scene: bpy.types.Scene) -> None:
    # Since 5.0 a sequencer editor shows the workspace's scene, and none is chosen at first.
    if getattr(context.workspace, "sequencer_scene", scene) is None:
        context.workspace.sequencer_scene = scene.playable_environment.edit_scene


def _names_in(context: bpy.types.Context | None) -> str:
    chosen = context.object if context is not None else None
    return chosen.playable.action_names if chosen is not None else ""


def _model_path(model: str) -> str:
    return bpy.path.abspath(model) if model.startswith("//") else model


def _boxes_from_json(text: str) -> dict[str, tuple[float, float, float, float]]:
    try:
        boxes = {name: tuple(map(float, box)) for name, box in json.loads(text).items()}
        if any(len(box) != 4 for box in boxes.values()):
            raise ValueError("a box has four numbers")
    except (ValueError, TypeError, AttributeError) as error:
        raise ShotError(
            f'expected boxes as JSON, {{"player_1": [left, top, right, bottom]}}, found {text!r} '
            f"({error})"
        ) from error
    return boxes


def _check_names(boxes: Mapping, known: tuple[str, ...]) -> None:
    if unknown := sorted(set(boxes) - set(known)):
        raise ShotError(
            f"the model has the playable objects {', '.join(known)}; there is no {unknown[0]!r}"
        )


def apply_preferences() -> None:
    """Hand the preferences, if the add-on is enabled and has any, to the session."""
    addon = bpy.context.preferences.addons.get(__package__)
    if addon is not None and addon.preferences is not None:
        addon.preferences.apply()


CLASSES = (
    PLAYABLE_OT_load_model,
    PLAYABLE_OT_new_environment,
    PLAYABLE_OT_bake_paths,
    PLAYABLE_OT_insert_action_key,
    PLAYABLE_OT_render_to_sequencer,
    PLAYABLE_OT_stop_worker,
)


def register() -> None:
    """Register the operators; by now the preferences can be read."""
    for each in CLASSES:
        bpy.utils.register_class(each)
    apply_preferences()


def unregister() -> None:
    """Undo `register`."""
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
