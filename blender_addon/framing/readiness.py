"""What a scene still lacks before its picture can become an environment, in an artist's words."""

from dataclasses import dataclass
from pathlib import Path

import bpy
from bpy.app.translations import pgettext_iface as iface_

from pe_runtime.contract.errors import PlayableEnvironmentError

from .backdrop import shown_size
from .box_limits import inside
from .cameras import has_shape, scene_camera
from .landmarks import FEWEST
from .strip_frames import frame_under_playhead

PICTURE, CAMERA, OBJECTS = 1, 2, 3


@dataclass(frozen=True)
class Lack:
    """Something that is missing.

    Attributes:
        step: In which of the panel's steps: PICTURE, CAMERA or OBJECTS.
        text: What to do about it.
    """

    step: int
    text: str


def edits_of(context: bpy.types.Context) -> list[bpy.types.Scene]:
    """The scenes whose sequencers may hold the picture, the likeliest first."""
    # Blender 5 edits a scene of the workspace's own choice.
    shown = getattr(context.workspace, "sequencer_scene", None)
    edits = (shown, context.scene, context.scene.playable_environment.edit_scene)
    return [each for each in edits if each is not None]


def missing(scene: bpy.types.Scene, edits: list[bpy.types.Scene]) -> Lack | None:
    """The first thing that is missing; None when the picture can be encoded."""
    return next(iter(all_missing(scene, edits)), None)


def all_missing(scene: bpy.types.Scene, edits: list[bpy.types.Scene]) -> list[Lack]:
    """Per step what is missing first; steps that are complete are not named."""
    settings = scene.playable_environment
    checks = (
        (PICTURE, _about_picture(settings, edits)),
        (CAMERA, _about_camera(scene)),
        (OBJECTS, _about_objects(settings)),
    )
    return [Lack(step, text) for step, text in checks if text]


def _about_picture(settings: bpy.types.PropertyGroup, edits: list[bpy.types.Scene]) -> str:
    framing = settings.framing
    if not settings.model:
        return "Choose a model file"
    if framing.picture_source == "IMAGE":
        return "" if framing.image else "Choose an Image"
    if framing.picture_source == "STRIP":
        try:
            frame_under_playhead(edits)
        except PlayableEnvironmentError:
            return "Move the sequencer's playhead onto a movie or image strip"
        return ""
    if not settings.image_path:
        return "Choose a picture"
    there = Path(bpy.path.abspath(settings.image_path)).is_file()
    return "" if there else "The picture's file is gone: choose another"


def _about_camera(scene: bpy.types.Scene) -> str:
    framing, size = scene.playable_environment.framing, shown_size(scene)
    if framing.camera_mode == "MATCH":
        return _about_points(framing)
    if framing.camera_mode == "USUAL":
        facts = framing.facts
        unknown = facts is not None and facts.usual_camera is None
        return "The model has no usual camera: match one" if unknown else ""
    if scene_camera(scene) is None:
        return "Choose a camera of the scene"
    if size is not None and not has_shape(scene.render, size):
        return "The scene's frame has another shape than the picture: use the picture's size"
    return ""


def _about_points(framing: bpy.types.PropertyGroup) -> str:
    placed = [each for each in framing.points if each.is_placed]
    if len(placed) < FEWEST:
        return iface_("Place {count} or more points of the ground").format(count=FEWEST)
    taken = {}
    for each in placed:
        other = taken.setdefault(tuple(each.place), each)
        if other != each:
            said = iface_("Say where {point} lies on the ground; {other} lies there already")
            return said.format(point=each.name, other=other.name)
    return ""


def _about_objects(settings: bpy.types.PropertyGroup) -> str:
    facts, boxes = settings.framing.facts, settings.typed_boxes()
    if not boxes and not (facts is not None and not facts.playable_names):
        return "Draw, find or type the box of one playable object or more"
    size = shown_size(settings.id_data)
    for name, box in boxes.items() if size else ():
        try:
            inside(name, box, size)
        except PlayableEnvironmentError:
            said = iface_("Draw the box of {name} again: it is empty or outside of the picture")
            return said.format(name=name)
    return ""
