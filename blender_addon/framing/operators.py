"""Opening a picture: its model is loaded, its objects are found and get their Empties."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path

import bpy
from bpy.props import EnumProperty, StringProperty

from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.model_facts import ModelFacts

from .. import playables
from ..pictures import read_picture
from ..playables import Picture
from ..scene_bridge import read_camera, world_from_environment
from ..session import session
from ..usual_camera import add_camera, usual_camera
from ..volumes import farthest
from ..worker_operator import Task, WorkerOperator, allowed, model_path


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
        return allowed(cls, context.mode == "OBJECT", "Leave edit or pose mode first")

    def task(self, context: bpy.types.Context) -> Task:
        scene = context.scene
        settings = scene.playable_environment
        model = model_path(self.model or settings.model)
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
        model = model_path(context.scene.playable_environment.model)

        def finish(facts: ModelFacts) -> str:
            settings = bpy.data.scenes[name].playable_environment
            settings.list_boxes(facts.playable_names)
            settings.note_facts(facts)
            terms = f"; weights: {facts.licence}" if facts.licence else ""
            players = ", ".join(facts.playable_names) or "nothing"
            return f"{facts.name}: {players} can be played{terms}"

        return Task(lambda *_: session.facts(model), finish)


def _add_usual_camera(
    scene: bpy.types.Scene, facts: ModelFacts, picture: Picture, state: Mapping
) -> None:
    layer = scene.view_layers[0]
    layer.update()
    root, eye = world_from_environment(layer.depsgraph), picture.camera
    add_camera(scene, eye, root, farthest(facts, state, eye.world_from_camera[:3, 3]))


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


CLASSES = (PLAYABLE_OT_load_model, PLAYABLE_OT_new_environment)


def register() -> None:
    """Register the operators."""
    for each in CLASSES:
        bpy.utils.register_class(each)


def unregister() -> None:
    """Undo `register`."""
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
