"""What overrides store in a .blend file: per object, and the styles that a scene has collected.

Keys store the numbers of enum items, so those never change their meaning.
"""

import bpy
from bpy.props import (
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from pe_runtime.contract.errors import ShotError

from ..state_files import stored_state
from .lenders import NOBODY, Lender, lender_items, lenders_of, player_items, source_items

OVERRIDABLE = {"LIBRARY_OVERRIDABLE"}
PLACES = (
    ("FOLLOW", "Follow the Path", "Stands where the model predicts; baking keys its path", 0),
    (
        "FREE",
        "Free",
        "Stands where its own location and rotation keys put it; baking leaves those keys alone",
        1,
    ),
)
STYLES = (
    ("OWN", "Own", "Looks as in the environment's picture", 0),
    ("OBJECT", "From Object", "Takes on the look of another object of the picture", 1),
    ("PICTURE", "From Picture", "Takes on the look of an object in another picture", 2),
)
POSES = (
    ("FREE", "Free", "Moves its limbs as the model predicts", 0),
    ("HELD", "Held", "Keeps the pose of the frame where holding begins, wherever it goes", 1),
)
CAMERAS = (
    ("USUAL", "Usual Camera", "Such pictures are usually taken from there"),
    ("SCENE", "Scene Camera", "The scene's camera, which must match the picture"),
)


def scene_of(target: bpy.types.Object) -> bpy.types.Scene | None:
    """The scene whose environment a playable object belongs to."""
    target = target.original
    for scene in bpy.data.scenes:
        if scene.playable_environment.root and scene.objects.get(target.name) == target:
            return scene
    return None


def _objects_to_choose(self: "OverrideSettings", _context: object) -> tuple:
    scene = scene_of(self.id_data)
    block = scene.playable_environment.state_text if scene else None
    if block is None:
        return (NOBODY,)
    try:
        state = stored_state(block.as_string(), block.name)
        return lender_items(state, self.id_data.playable.object_name)
    except ShotError:
        return (NOBODY,)


def _sources_to_choose(self: "OverrideSettings", _context: object) -> tuple:
    scene = scene_of(self.id_data)
    sources = scene.playable_environment.styles.sources if scene else ()
    return source_items(tuple((each.number, each.name) for each in sources))


def _players_to_choose(self: "StyleLibrary", _context: object) -> tuple:
    names = [each.name for each in self.id_data.playable_environment.boxes]
    return player_items(tuple(names))


def _has_environment(self: "StyleLibrary", candidate: bpy.types.Scene) -> bool:
    return candidate != self.id_data and candidate.playable_environment.root is not None


def _show(self: "OverrideSettings", _context: object) -> None:
    # Blender itself evaluates again for a hand in a panel, but not for a script.
    self.id_data.update_tag()


class OverrideSettings(bpy.types.PropertyGroup):
    """On a playable object: what it has differently from the prediction. All of it can be keyed."""

    place: EnumProperty(
        name="Place",
        description=(
            "Whether it follows its predicted path. Its own keys of location and rotation count "
            "in every frame that is drawn; while it is free, baking does not replace them"
        ),
        items=PLACES,
        update=_show,
        override=OVERRIDABLE,
    )
    style: EnumProperty(
        name="Style",
        description="Whose look it has",
        items=STYLES,
        update=_show,
        override=OVERRIDABLE,
    )
    style_object: EnumProperty(
        name="Object",
        description="The object of the same class that lends its look",
        items=_objects_to_choose,
        update=_show,
        override=OVERRIDABLE,
    )
    style_source: EnumProperty(
        name="Picture",
        description="The style from another picture; add them under Styles",
        items=_sources_to_choose,
        update=_show,
        override=OVERRIDABLE,
    )
    style_mix: FloatProperty(
        name="Mix",
        description="How much of the other look it takes on: 0 keeps its own, 1 is all the other's",
        default=1.0,
        min=0.0,
        max=1.0,
        subtype="FACTOR",
        update=_show,
        override=OVERRIDABLE,
    )
    pose: EnumProperty(
        name="Pose",
        description=(
            "Held keeps the pose that was predicted for the frame of the first Held key; without "
            "keys, that of the first baked frame"
        ),
        items=POSES,
        update=_show,
        override=OVERRIDABLE,
    )

    def persist(self) -> None:
        """Be in the file even where nothing is overridden.

        A library override can change what its library has stored, not what is left at defaults.
        """
        for name in ("place", "style", "style_mix", "pose"):
            setattr(self, name, getattr(self, name))

    @property
    def lender_number(self) -> int:
        """What is chosen of the picture's objects, also where that is no longer on offer."""
        return int(self.get("style_object", 0))

    @property
    def source_number(self) -> int:
        """What is chosen of the scene's styles, also where that was removed."""
        return int(self.get("style_source", 0))


class StyleSource(bpy.types.PropertyGroup):
    """A look from another picture; its `name` is for people."""

    number: IntProperty(
        description="What keys store for it; never used twice",
        options={"HIDDEN"},
        override=OVERRIDABLE,
    )
    text: PointerProperty(
        name="State",
        description="The other picture, encoded, as JSON",
        type=bpy.types.Text,
        override=OVERRIDABLE,
    )
    object_name: StringProperty(
        name="Object", description="The object of that picture", override=OVERRIDABLE
    )
    model: StringProperty(
        name="Model", description="The model that encoded it", override=OVERRIDABLE
    )

    def state(self) -> str:
        """The encoded picture, as `state_file` takes it.

        Raises:
            ShotError: Its text block is gone or damaged.
        """
        if self.text is None:
            raise ShotError(
                f"the style {self.name!r} has lost its text block; remove it and add it again"
            )
        return stored_state(self.text.as_string(), self.text.name)

    def lender(self) -> Lender:
        """The object of the picture.

        Raises:
            ShotError: Its text block is gone, damaged or does not show the object.
        """
        lender = lenders_of(self.state()).get(self.object_name)
        if lender is None:
            raise ShotError(
                f"the picture of the style {self.name!r} shows no {self.object_name!r}; remove the "
                "style and add it again"
            )
        return lender


class StyleLibrary(bpy.types.PropertyGroup):
    """On a scene: the looks from other pictures, and how the next one is taken."""

    sources: CollectionProperty(type=StyleSource, override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"})
    active: IntProperty(
        name="Active Style",
        description="The style that Remove Style takes away",
        options=set(),
        override=OVERRIDABLE,
    )
    last_number: IntProperty(options={"HIDDEN"}, override=OVERRIDABLE)
    image_path: StringProperty(
        name="Picture",
        description="Another picture, in which somebody looks as wanted",
        subtype="FILE_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
        override=OVERRIDABLE,
    )
    scene: PointerProperty(
        name="Scene",
        description="Another scene with an environment of the same model",
        type=bpy.types.Scene,
        poll=_has_environment,
        override=OVERRIDABLE,
    )
    player: EnumProperty(
        name="Object",
        description="Which playable object of the model is seen there; none: the active Empty's",
        items=_players_to_choose,
        options=set(),
        override=OVERRIDABLE,
    )
    box: FloatVectorProperty(
        name="Box",
        description=(
            "Where it is in that picture: left, top, right, bottom in pixels. All zero: it is "
            "looked for, where a detector is installed"
        ),
        size=4,
        min=0.0,
        precision=1,
        options=set(),
        override=OVERRIDABLE,
    )
    camera: EnumProperty(
        name="Camera",
        description="Which camera saw that picture",
        items=CAMERAS,
        options=set(),
        override=OVERRIDABLE,
    )

    def player_name(self) -> str:
        """The object that the other picture shows; empty where none is chosen."""
        names = [each.name for each in self.id_data.playable_environment.boxes]
        number = int(self.get("player", 0))
        return names[number - 1] if 0 < number <= len(names) else ""

    def by_number(self, number: int) -> StyleSource | None:
        """The style of a number; None where it was removed."""
        return next((each for each in self.sources if each.number == number), None)

    def add(self, name: str, object_name: str, model: str, text: bpy.types.Text) -> StyleSource:
        """Add a style and make it the active one."""
        self.last_number += 1
        made = self.sources.add()
        made.name, made.number, made.text = name, self.last_number, text
        made.object_name, made.model = object_name, model
        self.active = len(self.sources) - 1
        return made
