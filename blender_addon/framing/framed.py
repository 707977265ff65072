"""A picture on its way to become an environment, as plain data for those who draw it or judge it.

Cheap enough to be asked at every redraw: nobody waits for the worker.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import bpy

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import PlayableEnvironmentError
from pe_runtime.contract.model_facts import ModelFacts

from .backdrop import Size, shown_size
from .box_limits import Box
from .cameras import known_camera
from .settings import read_facts
from .warnings import FramingWarning, warnings_for


@dataclass(frozen=True)
class PlacedPoint:
    """A point of the ground that was placed on the picture.

    Attributes:
        name: As the list shows it.
        pixel: Where the picture shows it.
        place: Where it lies on the ground (x, y), metres, environment space.
        miss: Residual of the last match, pixels; negative while nothing was matched.
    """

    name: str
    pixel: tuple[float, float]
    place: tuple[float, float]
    miss: float


@dataclass(frozen=True)
class FramedPicture:
    """What is known of a picture before it is encoded.

    Attributes:
        size: Width and height, pixels.
        camera: The camera that saw it, environment space, on its pixels; None while unknown.
        holder: Name of the camera object through which it is looked at; empty without one.
        boxes: By playable object left, top, right, bottom, pixels.
        points: The ground points that are placed.
        warnings: By playable object what is unusual; under the empty name, of the camera.
        facts: The model's, once it is loaded.
        trouble: Why the camera cannot be the picture's, if so.
    """

    size: Size
    camera: Camera | None = None
    holder: str = ""
    boxes: Mapping[str, Box] = field(default_factory=dict)
    points: tuple[PlacedPoint, ...] = ()
    warnings: Mapping[str, tuple[FramingWarning, ...]] = field(default_factory=dict)
    facts: ModelFacts | None = None
    trouble: str = ""


def framed_picture(scene: bpy.types.Scene) -> FramedPicture | None:
    """The picture that a scene's settings are about; None without one, or once it is encoded.

    The same object as long as nothing has changed.
    """
    settings = scene.playable_environment
    framing, size = settings.framing, shown_size(scene)
    if size is None or (settings.root is not None and not framing.is_open):
        return None
    camera, holder, trouble = None, None, ""
    try:
        camera, holder = known_camera(scene, framing.facts, size)
    except PlayableEnvironmentError as error:
        trouble = str(error)
    boxes = tuple((name, tuple(box)) for name, box in settings.typed_boxes().items())
    points = tuple(
        PlacedPoint(each.name, tuple(each.pixel), tuple(each.place), each.miss)
        for each in framing.points
        if each.is_placed
    )
    name = holder.name if holder else ""
    return _judged((size, camera, name, trouble), boxes, points, framing.facts_text)


@lru_cache(maxsize=8)
def _judged(
    seen: tuple[Size, Camera | None, str, str],
    boxes: tuple[tuple[str, Box], ...],
    points: tuple[PlacedPoint, ...],
    facts_text: str,
) -> FramedPicture:
    size, camera, holder, trouble = seen
    facts = read_facts(facts_text)
    by_object: dict[str, tuple[FramingWarning, ...]] = {}
    for each in warnings_for(facts, camera, dict(boxes), size):
        by_object[each.object] = (*by_object.get(each.object, ()), each)
    return FramedPicture(size, camera, holder, dict(boxes), points, by_object, facts, trouble)
