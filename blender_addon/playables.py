"""Environment roots, playable Empties, action keys and baked paths.

A playable Empty is a child of the environment root, so its location is its ground point in
environment space. Baked paths are LINEAR keys on that location.
"""

import json
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.messages import ModelFacts
from pe_runtime.contract.shot import Shot, Start

from .bake import Bake
from .fcurves import make_stepped, own_curves, remove_curves, write_curve
from .pixels import use_exact_colours
from .scene_bridge import Moment, playable_objects
from .settings import ACTION_LIMIT, SCHEMA

ACTION_PATH = "playable.action"
STATE_FORMAT = 1
EMPTY_METRES = 0.5


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
    """Put an encoded picture into a scene: a root, an Empty per playable object, the settings.

    Done again in the same scene, Empties of the same name are kept with their action keys and
    move to the new positions; others stop being playable.

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
    settings.steps_per_second = facts.steps_per_second
    settings.job = settings.job or uuid.uuid4().hex
    settings.state_text = _write_text(
        settings.state_text, f"{scene.name} environment", _state_json(picture, state)
    )
    settings.bake_text = None
    settings.set_boxes(facts.playable_names, picture.boxes)
    _place_empties(scene, root, facts, picture.boxes, state)
    use_exact_colours(scene)
    scene.render.engine = "PLAYABLE_ENV"


def stored_start(settings: object) -> Start:
    """The start that a scene's environment was made from.

    Raises:
        ShotError: The scene has no environment, or its text block was damaged.
    """
    if settings.root is None or settings.state_text is None:
        raise ShotError("this scene has no environment; make one with New Playable Environment")
    try:
        content = json.loads(settings.state_text.as_string())["start"]
        camera = Camera.from_dict(content["camera"], f"{settings.state_text.name}: camera")
        boxes = {name: tuple(box) for name, box in content["boxes"].items()}
        return Start(image=content["image"], camera=camera, boxes=boxes)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ShotError(
            f"{settings.state_text.name!r} is no environment ({error!r}); "
            "make a new one from the picture"
        ) from error


def key_action(target: bpy.types.Object, frame: int, action: int) -> None:
    """Let a playable object do an action from a frame on, until its next key.

    Raises:
        ShotError: The object is not playable, or the model has no such action.
    """
    if not target.playable.is_playable:
        raise ShotError(f"{target.name!r} is not playable; choose one of the environment's Empties")
    names = action_names(target)
    if not 0 <= action < len(names):
        raise ShotError(
            f"{target.name!r} has the actions 0 to {len(names) - 1} ({', '.join(names)}), "
            f"not {action}"
        )
    own_curves(target)
    target.playable.action = f"A{action}"
    target.keyframe_insert(ACTION_PATH, frame=frame)
    make_stepped(target, ACTION_PATH)


def action_names(target: bpy.types.Object) -> list[str]:
    """The model's names for the actions of a playable object; the index is the action."""
    return json.loads(target.playable.action_names or "[]")


def write_bake(
    scene: bpy.types.Scene, shot: Shot, paths: Mapping[str, np.ndarray], moments: Sequence[Moment]
) -> None:
    """Key predicted paths on the Empties and remember the shot they belong to; main thread only.

    Args:
        scene: The scene that the shot was sampled from.
        shot: The shot that was rolled out.
        paths: Per object (frames, 3) positions in environment space, metres.
        moments: The sampled frames of the shot.

    Raises:
        ShotError: A path is missing or too short, or an Empty cannot take it.
    """
    objects = playable_objects(scene)
    frames = np.arange(shot.frame_start, shot.frame_end + 1, dtype=np.float64)
    kept = {name: _checked_path(name, paths, len(frames)) for name in objects}
    locals_ = {name: _in_parent(each, kept[name], scene, moments) for name, each in objects.items()}
    for name, each in objects.items():
        curves = own_curves(each)
        for axis in range(3):
            write_curve(curves, "location", axis, frames, locals_[name][:, axis])
    settings = scene.playable_environment
    settings.bake_text = _write_text(
        settings.bake_text, f"{scene.name} bake", Bake(shot, kept).to_json()
    )
    scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)


def _checked_path(name: str, paths: Mapping[str, np.ndarray], count: int) -> np.ndarray:
    path = np.asarray(paths.get(name, ()), np.float64)
    if path.shape != (count, 3) or not np.isfinite(path).all():
        raise ShotError(
            f"expected {count} finite positions for {name!r} from the worker, found an array of "
            f"shape {path.shape}; use an add-on and a runtime of the same version"
        )
    return path


def _in_parent(
    each: bpy.types.Object, path: np.ndarray, scene: bpy.types.Scene, moments: Sequence[Moment]
) -> np.ndarray:
    """The path in the space of the object's location channels."""
    points = np.concatenate([path, np.ones((len(path), 1))], axis=1)
    if each.parent is not None and each.parent == scene.playable_environment.root:
        local_from_environment = np.linalg.inv(np.array(each.matrix_parent_inverse))
        return (points @ local_from_environment.T)[:, :3]
    if each.parent is None:
        matrices = np.stack([moment.world_from_environment for moment in moments])
        return np.einsum("fij,fj->fi", matrices, points)[:, :3]
    raise ShotError(
        f"{each.name!r} is parented to {each.parent.name!r}; parent it to the environment root "
        "or to nothing, so that its path can be keyed"
    )


def _new_root(scene: bpy.types.Scene) -> bpy.types.Object:
    root = bpy.data.objects.new("Playable Environment", None)
    root.empty_display_type = "ARROWS"
    scene.collection.objects.link(root)
    return root


def _place_empties(
    scene: bpy.types.Scene,
    root: bpy.types.Object,
    facts: ModelFacts,
    boxes: Mapping[str, object],
    state: Mapping,
) -> None:
    standing = playable_objects(scene)
    for name in set(standing) - set(boxes):
        standing[name].playable.is_playable = False
    for name in facts.playable_names:
        if name in boxes:
            each = standing.get(name) or _new_empty(scene, root, name)
            each.playable.action_names = json.dumps(facts.action_names[name][:ACTION_LIMIT])
            remove_curves(each, "location")
            each.location = state["objects"][name]["position"]


def _new_empty(scene: bpy.types.Scene, root: bpy.types.Object, name: str) -> bpy.types.Object:
    each = bpy.data.objects.new(name, None)
    each.empty_display_type, each.empty_display_size = "SINGLE_ARROW", EMPTY_METRES
    each.parent = root
    each.playable.is_playable, each.playable.object_name = True, name
    scene.collection.objects.link(each)
    return each


def _state_json(picture: Picture, state: Mapping) -> str:
    start = {
        "image": picture.path,
        "camera": picture.camera.as_dict(),
        "boxes": {name: list(map(float, box)) for name, box in picture.boxes.items()},
    }
    return json.dumps({"format": STATE_FORMAT, "start": start, "state": state})


def _write_text(block: bpy.types.Text | None, name: str, content: str) -> bpy.types.Text:
    block = block or bpy.data.texts.new(name)
    block.clear()
    block.write(content)
    return block
