"""Which camera saw the picture: the model's usual one, a matched one, or one of the scene."""

import json
import math
from functools import lru_cache

import bpy
import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import CameraError, ShotError
from pe_runtime.contract.model_facts import ModelFacts

from ..scene_bridge import camera_of, inverse_of
from ..usual_camera import put_camera, usual_camera
from ..worker.replies import MatchedCamera
from .landmarks import FEWEST, focal_of, misses

Size = tuple[int, int]
ASPECT_TOLERANCE = 0.01
"""Share by which the shapes of the picture and of the scene's frame may differ."""
USUAL_REACH = 100.0
"""Metres that the viewport shows before a camera while nobody knows the model's volumes."""


def environment_matrix(scene: bpy.types.Scene) -> np.ndarray:
    """(4, 4) float64 matrix of the scene's environment root; identity without one."""
    root = scene.playable_environment.root
    return np.eye(4) if root is None else np.array(root.matrix_world, np.float64)


def scene_camera(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The camera that a scene's settings name, or its active one."""
    chosen = scene.playable_environment.framing.camera
    if chosen is not None and chosen.name in scene.objects:
        return chosen
    return scene.camera


def own_camera(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The camera that was made for the scene's picture, unless the artist has made it theirs.

    One that is keyed or hangs on something else films by now: it is left alone.
    """
    holder = scene.playable_environment.framing.own_camera
    if holder is None or holder.name not in scene.objects or holder.parent is not None:
        return None
    keyed = holder.animation_data is not None or holder.data.animation_data is not None
    return None if keyed or holder.constraints or not holder.is_editable else holder


def seen_by(
    holder: bpy.types.Object,
    render: bpy.types.RenderSettings,
    world_from_environment: np.ndarray,
    size: Size,
) -> Camera:
    """What a camera object sees on a picture that fills its frame, environment space.

    Args:
        holder: Evaluated, where drivers or constraints move it.
        render: The scene's, for the shape of the frame.
        world_from_environment: (4, 4) matrix of the environment root.
        size: Width and height of the picture, pixels.

    Raises:
        CameraError: It is no pinhole camera, or the picture has another shape than its frame.
    """
    check_shape(render, size)
    return camera_of(holder, render, inverse_of(world_from_environment), size)


def check_shape(render: bpy.types.RenderSettings, size: Size) -> None:
    """Refuse a picture of another shape than the scene's frame: it would not fill it.

    Raises:
        CameraError: What both are, and how to make them alike.
    """
    if not has_shape(render, size):
        raise CameraError(
            f"the scene renders {render.resolution_x} x {render.resolution_y}, the picture is "
            f"{size[0]} x {size[1]}: press Use Picture Size, or choose the camera's own picture"
        )


def has_shape(render: bpy.types.RenderSettings, size: Size) -> bool:
    """Whether a picture is as wide for its height as the scene's frame."""
    width = render.resolution_x * render.pixel_aspect_x
    frame = width / (render.resolution_y * render.pixel_aspect_y)
    return math.isclose(frame, size[0] / size[1], rel_tol=ASPECT_TOLERANCE)


def use_size(render: bpy.types.RenderSettings, size: Size) -> None:
    """Let a scene render pictures of this size, on square pixels."""
    render.resolution_x, render.resolution_y = size
    render.resolution_percentage = 100
    render.pixel_aspect_x = render.pixel_aspect_y = 1.0


def hold_camera(scene: bpy.types.Scene, eye: Camera, reach: float) -> bpy.types.Object:
    """Have the scene's own picture camera see what `eye` sees; made if there is none.

    Args:
        scene: Gets the camera as its active one, and the picture's resolution.
        eye: Environment space, on the picture's pixels.
        reach: Environment metres that the viewport should show before it.
    """
    held = own_camera(scene)
    holder = put_camera(scene, eye, environment_matrix(scene), reach or USUAL_REACH, held)
    scene.playable_environment.framing.own_camera = holder
    return holder


def match_question(scene: bpy.types.Scene, size: Size) -> tuple[list[list[float]], float | None]:
    """The points [u, v, x, y] and the focal length (pixels or None) that a match starts from.

    Raises:
        ShotError: There are too few points.
    """
    framing = scene.playable_environment.framing
    points = [[float(number) for number in point] for point in framing.placed_points()]
    if len(points) < FEWEST:
        raise ShotError(
            f"matching needs {FEWEST} or more points of the ground, {len(points)} placed so far; "
            "press Place Points and click where the picture shows them"
        )
    return points, focal_of(framing.field_of_view, size[0]) if framing.is_lens_known else None


def match_key(scene: bpy.types.Scene, size: Size) -> str:
    """What a match depends on, to be compared: empty while there are too few points."""
    try:
        return json.dumps([*match_question(scene, size), size])
    except ShotError:
        return ""


def keep_match(scene: bpy.types.Scene, key: str, found: MatchedCamera) -> None:
    """Remember a matched camera and how well every point fits it."""
    framing = scene.playable_environment.framing
    framing.matched = json.dumps({"key": key, "camera": found.camera.as_dict()})
    framing.residual = found.residual
    placed = [each for each in framing.points if each.is_placed]
    for point, miss in zip(placed, misses(found.camera, framing.placed_points()), strict=True):
        point.miss = float(np.nan_to_num(miss, nan=-1.0))


def matched_camera(scene: bpy.types.Scene, size: Size) -> Camera | None:
    """The camera that was matched to the points as they are now; None once they have moved."""
    key, camera = _read_match(scene.playable_environment.framing.matched)
    return camera if key and key == match_key(scene, size) else None


@lru_cache(maxsize=8)
def _read_match(text: str) -> tuple[str, Camera | None]:
    try:
        content = json.loads(text)
        return content["key"], Camera.from_dict(content["camera"], "the matched camera")
    except (ValueError, TypeError, KeyError, CameraError):
        return "", None


def known_camera(
    scene: bpy.types.Scene, facts: ModelFacts | None, size: Size
) -> tuple[Camera | None, bpy.types.Object | None]:
    """The picture's camera as far as it is known without the worker, and the object that holds it.

    Raises:
        CameraError, ShotError: The chosen camera cannot be the picture's.
    """
    framing, matrix = scene.playable_environment.framing, environment_matrix(scene)
    if framing.camera_mode == "SCENE":
        holder = scene_camera(scene)
        return (None if holder is None else seen_by(holder, scene.render, matrix, size)), holder
    held = framing.own_camera
    held = held if held is not None and held.name in scene.objects else None
    if framing.camera_mode == "MATCH":
        return matched_camera(scene, size), held
    return (None if facts is None else usual_camera(facts, *size)), held
