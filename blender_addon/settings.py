"""What the add-on stores in a .blend file.

A scene carries one environment; an Empty with `playable.is_playable` stands for one of its
objects. Actions are an enum of fixed numbers: a key stores the number, so the numbers never change
their meaning, while how many there are and their labels come from the model.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    IntVectorProperty,
    PointerProperty,
    StringProperty,
)

from pe_runtime.contract.model_facts import ModelFacts

from .framing.settings import FramingSettings, GroundPoint, TrackedObject, have_one_each
from .overlay.settings import OverlaySettings
from .overrides.settings import OverrideSettings, StyleLibrary, StyleSource
from .playing.settings import PlayingSettings
from .strips.settings import StripSettings

SCHEMA = 2
UNNAMED_ACTIONS = 16
"""Actions that are offered where no model has named any."""
QUALITIES = (
    ("exact", "Exact", "Nothing is approximated"),
    ("balanced", "Balanced", "Faster, hardly visible differences"),
    ("draft", "Draft", "Fastest, for looking at movement"),
)


@lru_cache(maxsize=64)
def action_items(names_json: str) -> tuple[tuple[str, str, str, int], ...]:
    """Enum items with fixed numbers, one for each of a JSON list of the model's names."""
    # Cached for its references too: Blender does not keep the strings of dynamic items alive.
    names = json.loads(names_json) if names_json else []
    labels = [name.replace("_", " ").capitalize() for name in names]
    labels = labels or [f"Action {number}" for number in range(UNNAMED_ACTIONS)]
    return tuple(
        (f"A{number}", label, f"Action {number} of the model", number)
        for number, label in enumerate(labels)
    )


def _items_for(self: "PlayableSettings", _context: object) -> tuple:
    return action_items(self.action_names)


def _show_passes(target: bpy.types.Object) -> None:
    """Let compositor nodes of the object's scenes offer the passes that there are now."""
    for scene in bpy.data.scenes:
        if scene.objects.get(target.name) == target:
            _show_passes_of(scene)


def _show_passes_of(scene: bpy.types.Scene) -> None:
    for layer in scene.view_layers:
        layer.update_render_passes()


def _is_empty(_self: object, candidate: bpy.types.Object) -> bool:
    return candidate.type == "EMPTY"


def _note_picture(self: "EnvironmentSettings", _context: object) -> None:
    self.framing.note_path(self.image_path)


def _note_box(self: "BoxSettings", _context: object) -> None:
    self.id_data.playable_environment.framing.is_open = True


def _file_path(name: str, description: str) -> Any:  # noqa: ANN401 - bpy's deferred property
    # Blender 4.5 warns about file paths that do not say whether "//" is understood.
    understands = {"PATH_SUPPORTS_BLEND_RELATIVE"}
    return StringProperty(
        name=name,
        description=description,
        subtype="FILE_PATH",
        options=understands,
        update=_note_picture,
    )


class PlayableSettings(bpy.types.PropertyGroup):
    """On an object: which playable object it stands for and what that object does."""

    is_playable: BoolProperty(
        name="Playable",
        description="This Empty stands for a playable object",
        default=False,
        options=set(),
        override={"LIBRARY_OVERRIDABLE"},
    )
    object_name: StringProperty(
        name="Object",
        description="The playable object's name in the model",
        override={"LIBRARY_OVERRIDABLE"},
    )
    action: EnumProperty(
        name="Action",
        description="What the object does from this frame to the next key",
        # Else Blender translates those of a model's names that it happens to know.
        translation_context="Playable",
        items=_items_for,
        default=0,
        override={"LIBRARY_OVERRIDABLE"},
    )
    action_names: StringProperty(
        description="The model's names for the actions, a JSON list",
        options={"HIDDEN"},
        override={"LIBRARY_OVERRIDABLE"},
    )
    action_movements: StringProperty(
        description="Where actions lead: to the right of the camera and ahead, metres a step, JSON",
        options={"HIDDEN"},
        override={"LIBRARY_OVERRIDABLE"},
    )
    use_mask: BoolProperty(
        name="Mask",
        description="Render a pass with the pixels that show the object",
        update=lambda self, _context: _show_passes(self.id_data),
        override={"LIBRARY_OVERRIDABLE"},
    )
    use_layer: BoolProperty(
        name="Layer",
        description="Render a pass with the object alone, where nothing stands before it",
        update=lambda self, _context: _show_passes(self.id_data),
        override={"LIBRARY_OVERRIDABLE"},
    )
    overrides: PointerProperty(type=OverrideSettings, override={"LIBRARY_OVERRIDABLE"})


class BoxSettings(bpy.types.PropertyGroup):
    """Where a playable object stands in the picture; its `name` is the object's."""

    box: FloatVectorProperty(
        name="Box",
        description="Left, top, right, bottom in pixels; all zero: not in the picture",
        size=4,
        min=0.0,
        options=set(),
        precision=1,
        update=_note_box,
    )
    is_shown: BoolProperty(name="Numbers", description="Show the numbers of the box", options=set())


class EnvironmentSettings(bpy.types.PropertyGroup):
    """On a scene: the environment that its render engine films."""

    schema: IntProperty(default=0, options={"HIDDEN"})
    model: StringProperty(
        name="Model",
        description="A built-in model's name or a model file, such as pe import-official writes",
        subtype="FILE_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
        default="duel",
        update=lambda self, _context: self.forget_facts(),
    )
    native_size: IntVectorProperty(
        name="Size", description="Pixels of the pictures that the model was made for", size=2
    )
    licence: StringProperty(name="Licence", description="Terms of the model's weights")
    image_path: _file_path("Picture", "The picture that became this environment")
    boxes: CollectionProperty(type=BoxSettings)
    root: PointerProperty(
        name="Root",
        description="Empty that places the environment in the scene",
        type=bpy.types.Object,
        poll=_is_empty,
    )
    state_text: PointerProperty(
        name="State", description="The encoded picture, as JSON", type=bpy.types.Text
    )
    bake_text: PointerProperty(
        name="Bake", description="The baked shot and its paths, as JSON", type=bpy.types.Text
    )
    edit_scene: PointerProperty(
        name="Edit Scene",
        description="Scene whose sequencer holds the rendered strip",
        type=bpy.types.Scene,
    )
    stand_in_for: PointerProperty(
        description="On a scene that is only there to be sampled: the one that it is sampled for",
        type=bpy.types.Scene,
        options={"HIDDEN"},
    )
    steps_per_second: FloatProperty(
        name="Steps per Second", description="The pace at which the model moves", default=5.0
    )
    job: StringProperty(description="Ties this scene to its strip", options={"HIDDEN"})
    quality: EnumProperty(name="Quality", description="What rendering skips", items=QUALITIES)
    use_background: BoolProperty(
        name="Background",
        description="Render a pass with the environment without its playable objects",
        update=lambda self, _context: _show_passes_of(self.id_data),
        override={"LIBRARY_OVERRIDABLE"},
    )
    frames_folder: StringProperty(
        name="Frames",
        description="Folder for the rendered frames",
        subtype="DIR_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
        default="//frames",
    )
    overlay: PointerProperty(type=OverlaySettings)
    framing: PointerProperty(type=FramingSettings)
    playing: PointerProperty(type=PlayingSettings, override={"LIBRARY_OVERRIDABLE"})
    strips: PointerProperty(type=StripSettings)
    styles: PointerProperty(type=StyleLibrary, override={"LIBRARY_OVERRIDABLE"})

    def of_newer_addon(self) -> str:
        """Why an environment of a later version cannot be worked on; empty where it can."""
        if self.schema <= SCHEMA:
            return ""
        return (
            f"{self.id_data.name!r} was made by a newer version of the add-on (schema "
            f"{self.schema}, this one knows {SCHEMA}); update the add-on before you change or "
            "render it"
        )

    def note_facts(self, facts: ModelFacts) -> None:
        """Keep what the panel tells of the model, so that it needs no worker for it."""
        self.steps_per_second = facts.steps_per_second
        self.native_size = facts.width, facts.height
        self.licence = facts.licence
        self.framing.note_facts(facts)

    def forget_facts(self) -> None:
        """Tell nothing of a model that has not been loaded yet."""
        self.native_size, self.licence = (0, 0), ""
        self.framing.facts_text = ""

    def list_boxes(self, names: Iterable[str]) -> None:
        """Have one box for each of these objects; boxes that were typed already stay."""
        have_one_each(self.boxes, names)

    def set_boxes(self, names: Iterable[str], boxes: Mapping[str, Sequence[float]]) -> None:
        """Show these boxes for typing on; objects without one are not in the picture."""
        self.list_boxes(names)
        for each in self.boxes:
            each.box = boxes.get(each.name, (0.0, 0.0, 0.0, 0.0))

    def typed_boxes(self) -> dict[str, tuple[float, float, float, float]]:
        """The boxes of those objects that are in the picture."""
        return {each.name: tuple(each.box) for each in self.boxes if any(each.box)}


CLASSES = (
    OverrideSettings,
    StyleSource,
    StyleLibrary,
    PlayableSettings,
    BoxSettings,
    OverlaySettings,
    GroundPoint,
    TrackedObject,
    FramingSettings,
    PlayingSettings,
    StripSettings,
    EnvironmentSettings,
)


def register() -> None:
    """Register the groups and hang them on Scene and Object."""
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Scene.playable_environment = PointerProperty(type=EnvironmentSettings)
    # Without this, what a library override changes in it is lost when the file is opened again.
    overridable = {"LIBRARY_OVERRIDABLE"}
    bpy.types.Object.playable = PointerProperty(type=PlayableSettings, override=overridable)


def unregister() -> None:
    """Undo `register`."""
    del bpy.types.Object.playable
    del bpy.types.Scene.playable_environment
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
