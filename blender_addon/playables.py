"""Environment roots, playable Empties and action keys.

A playable Empty is a child of the environment root, so its location is its ground point in
environment space and its turn about z its heading.
"""

import json
import uuid
from collections.abc import Mapping
from dataclasses import dataclass

import bpy

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.model_facts import ModelFacts
from pe_runtime.contract.shot import Start

from .fcurves import ACTION_PATH, make_stepped, own_curves, remove_curves
from .filming.pixels import use_equal_files, use_exact_colours
from .json_text import json_text
from .scene_bridge import ENGINE, action_names, playable_objects
from .settings import SCHEMA
from .state_files import state_file, stored_state
from .volumes import height_of, show_volumes

STATE_FORMAT = 1
USUAL_HEIGHT = 1.0
"""Metres of an Empty whose object has no known volume."""


@dataclass(frozen=True)
class Picture:
    """What a new environment is made from.

    Attributes:
        path: Absolute path of the picture.
        camera: The camera that saw it, in environment space, on the picture's pixel grid.
        boxes: Per playable object left, top, right, bottom in pixels.
    """

    path: str
    camera: Camera
    boxes: Mapping[str, tuple[float, float, float, float]]

    @property
    def start(self) -> Start:
        """The picture as the start of a Shot."""
        return Start(image=self.path, camera=self.camera, boxes=self.boxes)


def build_environment(
    scene: bpy.types.Scene, model: str, facts: ModelFacts, picture: Picture, state: Mapping
) -> None:
    """Put an encoded picture into a scene: a root, Empties, their volumes, the settings.

    Done again in the same scene, Empties of the same name are kept with their action keys and
    move and turn to where the picture shows them; others stop being playable.

    Args:
        scene: Gets the environment, exact colours and the engine.
        model: The name or path under which the model was loaded.
        facts: What the worker told about it.
        picture: What was encoded.
        state: The worker's state of it, as JSON values.
    """
    settings = scene.playable_environment
    root = settings.root or _new_root(scene)
    settings.root, settings.schema, settings.model = root, SCHEMA, model
    settings.image_path = picture.path
    settings.note_facts(facts)
    settings.job = settings.job or uuid.uuid4().hex
    settings.state_text = write_text(
        settings.state_text, f"{scene.name} environment", state_json(picture, state)
    )
    settings.bake_text = None
    settings.set_boxes(facts.playable_names, picture.boxes)
    placed = _place_empties(scene, facts, picture.boxes, state)
    show_volumes(scene, facts, placed, state)
    use_exact_colours(scene)
    use_equal_files(scene.render)
    scene.render.engine = ENGINE


def stored_start(settings: object) -> Start:
    """The state that a scene's environment is, as the start of a Shot; no picture is needed.

    Raises:
        ShotError: The scene has no environment, its text block was damaged, or no file can be
            written for the worker.
    """
    if text := settings.of_newer_addon():
        raise ShotError(text)
    if settings.root is None or settings.state_text is None:
        raise ShotError("this scene has no environment; make one with New Playable Environment")
    block = settings.state_text
    return Start(state=str(state_file(stored_state(block.as_string(), block.name))))


def key_action(target: bpy.types.Object, frame: int, action: int) -> None:
    """Let a playable object do an action from a frame on, until its next key.

    Raises:
        ShotError: The object is not playable, or the model has no such action.
    """
    if not target.playable.is_playable:
        raise ShotError(f"{target.name!r} is not playable; choose one of the environment's Empties")
    names = action_names(target)
    if not names:
        raise ShotError(
            f"the model has no actions for {target.playable.object_name!r}: move {target.name!r} "
            "by keys on its location, or choose a model with trained actions"
        )
    if not 0 <= action < len(names):
        raise ShotError(
            f"{target.name!r} has the actions 0 to {len(names) - 1} ({', '.join(names)}), "
            f"not {action}"
        )
    own_curves(target)
    target.playable.action = f"A{action}"
    target.keyframe_insert(ACTION_PATH, frame=frame)
    make_stepped(target, ACTION_PATH)


def _new_root(scene: bpy.types.Scene) -> bpy.types.Object:
    root = bpy.data.objects.new("Playable Environment", None)
    root.empty_display_type = "ARROWS"
    scene.collection.objects.link(root)
    return root


def _place_empties(
    scene: bpy.types.Scene, facts: ModelFacts, boxes: Mapping[str, object], state: Mapping
) -> dict[str, bpy.types.Object]:
    """The Empties of the objects that have boxes, where the state puts them."""
    standing = playable_objects(scene)
    for name in set(standing) - set(boxes):
        standing[name].playable.is_playable = False
    return {
        name: place_empty(scene, name, facts, state["objects"][name])
        for name in facts.playable_names
        if name in boxes
    }


def place_empty(
    scene: bpy.types.Scene, name: str, facts: ModelFacts, found: Mapping
) -> bpy.types.Object:
    """The Empty of a playable object, made if there is none, where a state has found the object.

    Args:
        scene: With the environment.
        name: The object's, in the model.
        facts: The model's.
        found: The object in the state, as JSON values.
    """
    each = playable_objects(scene).get(name) or _new_empty(scene, name, facts)
    teach_actions(each, name, facts)
    for data_path in ("location", "rotation_euler"):
        remove_curves(each, data_path)
    each.location, each.rotation_mode = found["position"], "XYZ"
    each.rotation_euler = 0.0, 0.0, found.get("heading", 0.0)
    return each


def teach_actions(each: bpy.types.Object, name: str, facts: ModelFacts) -> None:
    """Give an Empty the model's actions; until it has keys, it does what nobody has to tell it."""
    names = json.dumps(facts.action_names[name])
    each.playable.overrides.persist()
    each.playable.action_movements = json.dumps(facts.movements.get(name, ()))
    if each.playable.action_names != names:
        each.playable.action_names = names
        each.playable.action = f"A{facts.resting_actions.get(name, 0)}"


def _new_empty(scene: bpy.types.Scene, name: str, facts: ModelFacts) -> bpy.types.Object:
    each = bpy.data.objects.new(name, None)
    height = height_of(facts.volumes.get(name), USUAL_HEIGHT)
    if name in facts.turning_names:
        each.empty_display_type, each.empty_display_size = "ARROWS", height / 2
    else:
        each.empty_display_type, each.empty_display_size = "SINGLE_ARROW", height
    each.parent = scene.playable_environment.root
    each.playable.is_playable, each.playable.object_name = True, name
    scene.collection.objects.link(each)
    return each


def state_json(picture: Picture, state: Mapping) -> str:
    """An encoded picture as the text of a Blender text block."""
    start = {
        "image": picture.path,
        "camera": picture.camera.as_dict(),
        "boxes": {name: list(map(float, box)) for name, box in picture.boxes.items()},
    }
    return json_text({"format": STATE_FORMAT, "start": start, "state": state})


def write_text(block: bpy.types.Text | None, name: str, content: str) -> bpy.types.Text:
    """Put a content into a text block, made if there is none yet."""
    block = block or bpy.data.texts.new(name)
    block.clear()
    block.write(content)
    return block
