"""The steps around encoding in Blender's data: from settings to a job, from a job to a scene."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import bpy

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.model_facts import ModelFacts

from .. import playables
from ..playables import Picture
from ..volumes import farthest
from .backdrop import hide_behind, picture_image, show_behind
from .box_limits import Box, all_inside
from .cameras import (
    hold_camera,
    keep_match,
    match_key,
    match_question,
    matched_camera,
    scene_camera,
)
from .picture_source import FoundPicture
from .warnings import warnings_for

COPIED_SETTINGS = ("model", "image_path", "quality")
COPIED_FRAMING = (
    *("picture_source", "image", "camera_mode", "is_lens_known", "field_of_view"),
    *("matched", "residual", "clip"),
)
COPIED_RENDER = ("fps", "fps_base", "resolution_x", "resolution_y", "resolution_percentage")


@dataclass(frozen=True, eq=False)
class Opening:
    """A picture with all that is needed to encode it, apart from Blender's data.

    Attributes:
        model: Name or path, as the worker takes it.
        found: The picture.
        boxes: Inside of the picture.
        mode: Where the camera comes from: USUAL, MATCH or SCENE.
        eye: The camera, where it is known already; environment space.
        question: Points and focal length of a match that has to be made first.
        notes: What the artist should know.
    """

    model: str
    found: FoundPicture
    boxes: Mapping[str, Box]
    mode: str
    eye: Camera | None
    question: tuple | None
    notes: tuple[str, ...]


def open_picture(
    scene: bpy.types.Scene,
    model: str,
    found: FoundPicture,
    boxes: Mapping[str, Box],
    camera: tuple[str, Camera | None],
) -> Opening:
    """Gather what encoding needs.

    Args:
        scene: With the ground points.
        model: As the worker takes it.
        found: The picture.
        boxes: As drawn or typed.
        camera: Where it comes from, and the camera where the scene holds it.

    Raises:
        ShotError: A box cannot be used, or there are too few points to match a camera.
    """
    mode, eye = camera
    kept, notes = all_inside(boxes, found.size)
    question = None
    if mode == "MATCH":
        eye = matched_camera(scene, found.size)
        question = match_question(scene, found.size) if eye is None else None
    return Opening(model, found, kept, mode, eye, question, tuple(notes))


def finish_opening(
    scene: bpy.types.Scene, opening: Opening, facts: ModelFacts, eye: Camera, state: Mapping
) -> str:
    """Put the encoded picture into a scene, with the camera that saw it, and say what was done."""
    picture = opening.found.keep()
    settings = scene.playable_environment
    typed = settings.image_path
    playables.build_environment(
        scene, opening.model, facts, Picture(picture.path, eye, opening.boxes), state
    )
    settings.image_path = _spelt(picture.path, typed)
    scene.view_layers[0].update()
    holder = scene_camera(scene) if opening.mode == "SCENE" else None
    if holder is None:
        holder = hold_camera(scene, eye, farthest(facts, state, eye.world_from_camera[:3, 3]))
    scene.camera = holder
    show_picture_behind(scene, holder, picture.path)
    if holder.data.is_editable:
        hide_behind(holder, settings.framing.backdrop)
    settings.framing.is_open = False
    return _summary(opening, facts, eye, picture)


def show_picture_behind(scene: bpy.types.Scene, holder: bpy.types.Object, path: str) -> None:
    """Show the scene's picture behind a camera."""
    framing = scene.playable_environment.framing
    image = picture_image(scene, path)
    if holder.data.is_editable:
        show_behind(holder, image, framing.backdrop)
    framing.backdrop = image


def note_match(scene: bpy.types.Scene, size: tuple[int, int], found: object) -> str:
    """Keep a matched camera, have the scene's picture camera see it, and say how well it fits."""
    keep_match(scene, match_key(scene, size), found)
    hold_camera(scene, found.camera, 0.0)
    return f"residual {found.residual:.2f} px, worst {found.worst:.2f} px"


def new_scene_like(scene: bpy.types.Scene) -> bpy.types.Scene:
    """A scene without an environment, with the same picture, pace and size."""
    made = bpy.data.scenes.new(f"{scene.name} environment")
    old, new = scene.playable_environment, made.playable_environment
    pairs = (
        (scene.render, made.render, COPIED_RENDER),
        (scene, made, ("frame_start", "frame_end")),
        (old, new, COPIED_SETTINGS),
        (old.framing, new.framing, COPIED_FRAMING),
    )
    for source, target, names in pairs:
        for name in names:
            setattr(target, name, getattr(source, name))
    for point in old.framing.points:
        new.framing.points.add().take(point.as_numbers())
    return made


def boxes_from_json(text: str) -> dict[str, Box]:
    """Boxes as a script gives them.

    Raises:
        ShotError: It is no JSON of them.
    """
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


def check_names(boxes: Iterable[str], known: tuple[str, ...]) -> None:
    """Refuse boxes of objects that the model does not have.

    Raises:
        ShotError: There is one.
    """
    if unknown := sorted(set(boxes) - set(known)):
        raise ShotError(
            f"the model has the playable objects {', '.join(known)}; there is no {unknown[0]!r}"
        )


def _spelt(path: str, typed: str) -> str:
    """A path as the artist wrote it, or else relative to a saved file that it lies beside."""
    if typed and Path(bpy.path.abspath(typed)).resolve() == Path(path):
        return typed
    beside = bpy.data.filepath and Path(path).is_relative_to(Path(bpy.data.filepath).parent)
    return bpy.path.relpath(path) if beside else path


def _summary(opening: Opening, facts: ModelFacts, eye: Camera, picture: FoundPicture) -> str:
    unusual = warnings_for(facts, eye, opening.boxes, picture.size)
    notes = [*opening.notes, *([picture.note] if picture.note else [])]
    if unusual:
        more = f" (and {len(unusual) - 1} more)" if len(unusual) > 1 else ""
        notes.append(f"unusual: {unusual[0].text}{more}")
    terms = [f"weights: {facts.licence}"] if facts.licence else []
    done = f"{len(opening.boxes)} playable objects found; colours are set to Standard"
    return "; ".join((done, *terms, *notes))
