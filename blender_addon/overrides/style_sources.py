"""The styles that a scene has collected: added from pictures, removed, and who asks for them."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath

import bpy

from pe_runtime.contract.errors import ShotError

from ..fcurves import every_curve, key_points
from ..playables import Picture, state_json, write_text
from ..scene_bridge import playable_objects
from ..state_files import stored_state
from .lenders import lenders_of

SOURCE_PATH = "playable.overrides.style_source"


@dataclass(frozen=True)
class Encoded:
    """Another picture, encoded.

    Attributes:
        picture: The picture, its camera and its boxes.
        state: The worker's state of it, as JSON values.
    """

    picture: Picture
    state: Mapping


def add_from_picture(scene: bpy.types.Scene, model: str, found: Encoded) -> list[str]:
    """Collect the styles of the objects in a picture; their names.

    Raises:
        ShotError: The picture shows none of them.
    """
    stem = Path(found.picture.path).stem
    content = state_json(found.picture, found.state)
    return _add(scene, model, stem, content, tuple(found.picture.boxes))


def add_from_scene(scene: bpy.types.Scene, other: bpy.types.Scene) -> list[str]:
    """Collect the styles of the players of another scene's environment; their names.

    Raises:
        ShotError: It has no environment, or one of another model.
    """
    settings, theirs = scene.playable_environment, other.playable_environment
    if theirs.root is None or theirs.state_text is None:
        raise ShotError(f"scene {other.name!r} has no environment; make one there first")
    if PurePath(settings.model).name != PurePath(theirs.model).name:
        raise ShotError(
            f"scene {other.name!r} uses the model {theirs.model!r}, this one {settings.model!r}; "
            "styles fit only the model that encoded them"
        )
    content = theirs.state_text.as_string()
    players = tuple(each.name for each in theirs.boxes)
    return _add(scene, theirs.model, other.name, content, players)


def remove_style(scene: bpy.types.Scene, index: int) -> list[str]:
    """Remove a style; the names of objects whose keys still ask for it."""
    styles = scene.playable_environment.styles
    number, text = styles.sources[index].number, styles.sources[index].text
    styles.sources.remove(index)
    styles.active = max(min(styles.active, len(styles.sources) - 1), 0)
    if text is not None and not any(each.text == text for each in styles.sources):
        bpy.data.texts.remove(text)
    keyed = []
    for each in playable_objects(scene).values():
        if _keys_ask_for(each, number):
            keyed.append(each.name)
        elif each.playable.overrides.source_number == number and each.is_editable:
            each.playable.overrides.style_source = "NONE"
    return keyed


def _add(
    scene: bpy.types.Scene, model: str, called: str, content: str, players: tuple[str, ...]
) -> list[str]:
    known = lenders_of(stored_state(content, called))
    shown = [name for name in players if name in known]
    if not shown:
        raise ShotError(f"{called!r} shows no playable object; give the box of one")
    text = write_text(None, f"{called} style", content)
    styles, names = scene.playable_environment.styles, []
    for name in shown:
        label = _free_name(scene, called if len(shown) == 1 else f"{called} {name}")
        styles.add(label, name, model, text)
        names.append(label)
    return names


def _free_name(scene: bpy.types.Scene, wanted: str) -> str:
    taken = {each.name for each in scene.playable_environment.styles.sources}
    name, count = wanted, 1
    while name in taken:
        name, count = f"{wanted}.{count:03d}", count + 1
    return name


def _keys_ask_for(target: bpy.types.Object, number: int) -> bool:
    curves = every_curve(target, SOURCE_PATH)
    return any((key_points(each)[:, 1].astype(int) == number).any() for each in curves)
