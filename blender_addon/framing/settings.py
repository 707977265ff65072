"""What is chosen for the next picture: its source, its camera, the ground points, the tracks.

Kept with the scene, so that a file tells how its environment was made and undo works.
"""

import json
from collections.abc import Iterable
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from pe_runtime.contract.errors import WorkerError
from pe_runtime.contract.model_facts import ModelFacts

BUILT_IN = ("duel",)
"""Models that come with the runtime."""
MODEL_FILE = "FILE"
SOURCES = (
    ("FILE", "File", "An image file", "FILE_IMAGE", 0),
    ("IMAGE", "Image", "An Image of this file: painted, packed or generated", "IMAGE_DATA", 1),
    ("STRIP", "Strip", "The movie or image strip under the sequencer's playhead", "SEQUENCE", 2),
)
CAMERAS = (
    ("USUAL", "Usual", "Where pictures of the model's world are usually taken from"),
    ("MATCH", "Match", "Found from four or more points of the ground that you place"),
    ("SCENE", "Scene", "A camera of this scene, such as a tracked one"),
)
POINT_NAME = "Point"


def _is_camera(_self: object, candidate: bpy.types.Object) -> bool:
    return candidate.type == "CAMERA"


def _model_items() -> tuple[tuple[str, str, str, int], ...]:
    built_in = [(name, name.capitalize(), "Comes with the runtime") for name in BUILT_IN]
    choices = [*built_in, (MODEL_FILE, "File", "A model file that you have trained or imported")]
    return tuple((*choice, number) for number, choice in enumerate(choices))


def _open(self: bpy.types.PropertyGroup, _context: object) -> None:
    self.id_data.playable_environment.framing.is_open = True


def _move(self: "GroundPoint", context: object) -> None:
    self.miss = -1.0
    _open(self, context)


def _set_pixel(self: "GroundPoint", context: object) -> None:
    self.is_placed = True
    _move(self, context)


class GroundPoint(bpy.types.PropertyGroup):
    """A point of the ground that is seen in the picture."""

    pixel: FloatVectorProperty(
        name="Pixel",
        description="Where the picture shows it, from the upper left corner",
        size=2,
        precision=1,
        options=set(),
        update=_set_pixel,
    )
    is_placed: BoolProperty(
        name="Placed", description="Whether it has a place in the picture", options=set()
    )
    place: FloatVectorProperty(
        name="Ground",
        description="Where it lies on the environment's ground: x and y, metres",
        size=2,
        precision=3,
        options=set(),
        update=_move,
    )
    miss: FloatProperty(
        name="Residual",
        description="Pixels between the point and where the matched camera sees its ground",
        default=-1.0,
        options=set(),
    )

    def as_numbers(self) -> tuple:
        """All of it, as `take` wants it."""
        return self.name, tuple(self.pixel), tuple(self.place), self.is_placed, self.miss

    def take(self, numbers: tuple) -> None:
        """Be what another point was."""
        # What is changed by hand counts as placed and not matched yet, so those two come last.
        self.name, self.pixel, self.place, self.is_placed, self.miss = numbers


class TrackedObject(bpy.types.PropertyGroup):
    """The tracking markers that surround a playable object; its `name` is the object's."""

    tracks: StringProperty(
        name="Tracks",
        description="A track, a plane track, or how the names of several tracks begin",
        options=set(),
    )


class FramingSettings(bpy.types.PropertyGroup):
    """On a scene: how the next picture becomes its environment."""

    model_choice: EnumProperty(
        name="Model",
        description="The model that knows how such a world looks and moves",
        items=_model_items(),
        get=lambda self: _chosen_model(self.id_data.playable_environment.model),
        set=lambda self, number: _choose_model(self.id_data.playable_environment, number),
        options=set(),
    )
    picture_source: EnumProperty(
        name="Picture", description="Where the picture comes from", items=SOURCES, options=set()
    )
    image: PointerProperty(
        name="Image", description="The Image that becomes an environment", type=bpy.types.Image
    )
    backdrop: PointerProperty(
        name="Backdrop", description="The picture behind the camera", type=bpy.types.Image
    )
    camera_mode: EnumProperty(
        name="Camera",
        description="Which camera saw the picture",
        translation_context="Playable",
        items=CAMERAS,
        options=set(),
        update=_open,
    )
    camera: PointerProperty(
        name="Camera",
        description="The camera that saw the picture; empty: the scene's active one",
        type=bpy.types.Object,
        poll=_is_camera,
    )
    own_camera: PointerProperty(
        name="Own Camera",
        description="The camera that was made for the picture",
        type=bpy.types.Object,
        poll=_is_camera,
    )
    points: CollectionProperty(type=GroundPoint)
    active_point: IntProperty(
        name="Active Point", description="The point that the fields below show", options=set()
    )
    is_lens_known: BoolProperty(
        name="Known Lens",
        description="Keep the field of view instead of finding it: needed where all points are "
        "close together or seen from straight above",
        options=set(),
    )
    field_of_view: FloatProperty(
        name="Field of View",
        translation_context="Playable",
        description="How much the camera sees from left to right",
        subtype="ANGLE",
        default=0.8727,
        min=0.0175,
        max=3.0,
        options=set(),
    )
    matched: StringProperty(description="What the camera was matched to", options={"HIDDEN"})
    residual: FloatProperty(
        name="Residual",
        description="Root mean square of the points' residuals, pixels",
        default=-1.0,
        options=set(),
    )
    clip: PointerProperty(
        name="Clip", description="Movie clip with tracking markers", type=bpy.types.MovieClip
    )
    tracked: CollectionProperty(type=TrackedObject)
    is_open: BoolProperty(
        name="Framing",
        description="Whether the picture is being framed again since it was last encoded",
        options={"HIDDEN"},
    )
    facts_text: StringProperty(description="What the model told, JSON", options={"HIDDEN"})

    @property
    def facts(self) -> ModelFacts | None:
        """The chosen model's facts; None until it has been loaded."""
        return read_facts(self.facts_text)

    def note_facts(self, facts: ModelFacts) -> None:
        """Keep a loaded model's facts, so that no redraw asks the worker."""
        self.facts_text = json.dumps(facts.as_fields())
        self.list_tracked(facts.playable_names)

    def note_path(self, path: str) -> None:
        """Look at the picture file that was chosen: its size is known, and cameras show it."""
        full, before = bpy.path.abspath(path), self.backdrop
        self.is_open, self.backdrop = True, None
        with suppress(RuntimeError):
            if path and Path(full).is_file():
                self.backdrop = bpy.data.images.load(full, check_existing=True)
                if not bpy.app.background:
                    self.backdrop.preview_ensure()
        if before is None or before == self.backdrop:
            return
        for holder in {self.own_camera, self.camera, self.id_data.camera} - {None}:
            for each in holder.data.background_images if holder.data.is_editable else ():
                if each.image == before:
                    each.image = self.backdrop

    def list_tracked(self, names: Iterable[str]) -> None:
        """Have a line for the tracks of each of these objects; what was typed already stays."""
        have_one_each(self.tracked, names)

    def placed_points(self) -> list[tuple[float, float, float, float]]:
        """[u, v, x, y] of the points that have a place in the picture."""
        return [(*each.pixel, *each.place) for each in self.points if each.is_placed]

    def add_point(self) -> GroundPoint:
        """A new point without a place, made the active one."""
        point = self.points.add()
        taken = {each.name for each in self.points}
        number = next(n for n in range(1, len(taken) + 2) if f"{POINT_NAME} {n}" not in taken)
        point.name, self.active_point = f"{POINT_NAME} {number}", len(self.points) - 1
        return point


def have_one_each(entries: bpy.types.bpy_prop_collection, names: Iterable[str]) -> None:
    """Have one entry for each of these names and no other; those that are there already stay."""
    wanted = list(names)
    for index in reversed(range(len(entries))):
        if entries[index].name not in wanted:
            entries.remove(index)
    for name in wanted:
        if name not in entries:
            entries.add().name = name


@lru_cache(maxsize=8)
def read_facts(text: str) -> ModelFacts | None:
    """The facts that a scene has kept; None where there are none, or other versions wrote them."""
    try:
        return ModelFacts.from_fields(json.loads(text)) if text else None
    except (ValueError, WorkerError):
        return None


def _chosen_model(model: str) -> int:
    return BUILT_IN.index(model) if model in BUILT_IN else len(BUILT_IN)


def _choose_model(settings: bpy.types.PropertyGroup, number: int) -> None:
    if _chosen_model(settings.model) != number:
        settings.model = BUILT_IN[number] if number < len(BUILT_IN) else ""


CLASSES = (GroundPoint, TrackedObject, FramingSettings)
