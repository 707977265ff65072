"""The evaluated scene, frame by frame, as the numbers that a Shot is made of.

Everything passes through the environment root: `world_from_environment` is its matrix, identity
where there is none, uniform scale allowed. Environment space is what the worker speaks.
"""

import dataclasses
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from pe_runtime.contract.camera import (
    OPENCV_FROM_BLENDER_AXES,
    BlenderLens,
    Camera,
    camera_from_blender,
)
from pe_runtime.contract.errors import CameraError, ShotError
from pe_runtime.contract.shot import (
    BACKGROUND_PASS,
    DEPTH_PASS,
    LAYER_PASS_PREFIX,
    MASK_PASS_PREFIX,
    SHOT_VERSION,
    ObjectTrack,
    Shot,
    Start,
)

from .fcurves import ACTION_PATH, held_value
from .overrides.reading import Override, read_override

ENGINE = "PLAYABLE_ENV"
"""What scenes call the render engine."""
UNIFORM_SCALE_TOLERANCE = 1e-4
picture_only: set[str] = set()
"""Scenes of which a range is rendered to files that hold no passes; not a setting, so that no
file can keep it."""
Point = tuple[float, float, float]


@dataclass(frozen=True)
class TrackMoment:
    """One playable object at one frame.

    Attributes:
        action: Index among the model's actions; None where the model has none for the object, or
            where it is hidden and not evaluated.
        location: Ground point in environment space, metres.
        visible: Whether renders show it.
        heading: Turn about the environment's z axis, radians.
        override: What else it has differently from the prediction.
    """

    action: int | None
    location: Point
    visible: bool
    heading: float = 0.0
    override: Override = Override()


@dataclass(frozen=True)
class Moment:
    """What the scene asks for at one frame.

    Attributes:
        frame: Scene frame.
        camera: The scene camera in environment space.
        world_from_environment: (4, 4) float64, rotation, translation and uniform scale.
        tracks: Playable objects by their name in the model.
    """

    frame: int
    camera: Camera
    world_from_environment: np.ndarray
    tracks: Mapping[str, TrackMoment]

    @property
    def scale(self) -> float:
        """Scene metres per environment metre."""
        return float(np.linalg.norm(self.world_from_environment[:3, 0]))


def playable_objects(scene: bpy.types.Scene) -> dict[str, bpy.types.Object]:
    """The playable objects of a scene by their name in the model.

    Raises:
        ShotError: Two objects claim one name, or one has none.
    """
    found: dict[str, bpy.types.Object] = {}
    for each in scene.objects:
        if not each.playable.is_playable:
            continue
        name = each.playable.object_name
        if not name:
            raise ShotError(f"{each.name!r} is playable but names no object of the model")
        if name in found:
            raise ShotError(
                f"{found[name].name!r} and {each.name!r} both stand for {name!r}; "
                "switch Playable off on one of them"
            )
        found[name] = each
    return dict(sorted(found.items()))


def camera_of(
    holder: bpy.types.Object,
    render: bpy.types.RenderSettings,
    environment_from_world: np.ndarray,
    picture_size: tuple[int, int] | None = None,
) -> Camera:
    """What an evaluated camera object sees, in environment space.

    Args:
        holder: The camera.
        render: The scene's, which decide the projection too.
        environment_from_world: (4, 4) float64.
        picture_size: Width and height of a picture that fills the camera's view, in place of the
            render settings' resolution.

    Raises:
        CameraError: It is not a pinhole.
    """
    lens = _lens_of(holder.data, render)
    if picture_size is not None:
        lens = dataclasses.replace(
            lens,
            resolution_x=picture_size[0],
            resolution_y=picture_size[1],
            resolution_percentage=100,
            pixel_aspect_x=1.0,
            pixel_aspect_y=1.0,
        )
    environment_from_camera = environment_from_world @ np.array(holder.matrix_world, np.float64)
    try:
        return camera_from_blender(lens, environment_from_camera)
    except CameraError as error:
        raise CameraError(f"camera {holder.name!r}: {error}") from error


def _lens_of(camera: bpy.types.Camera, render: bpy.types.RenderSettings) -> BlenderLens:
    return BlenderLens(
        type=camera.type,
        lens=camera.lens,
        sensor_width=camera.sensor_width,
        sensor_height=camera.sensor_height,
        sensor_fit=camera.sensor_fit,
        shift_x=camera.shift_x,
        shift_y=camera.shift_y,
        resolution_x=render.resolution_x,
        resolution_y=render.resolution_y,
        resolution_percentage=render.resolution_percentage,
        pixel_aspect_x=render.pixel_aspect_x,
        pixel_aspect_y=render.pixel_aspect_y,
    )


def read_camera(
    depsgraph: bpy.types.Depsgraph, picture_size: tuple[int, int] | None = None
) -> Camera:
    """The scene camera of an evaluated scene, in environment space.

    Args:
        depsgraph: Evaluated at the frame that is meant.
        picture_size: Width and height of a picture that fills the camera's view, in place of the
            render settings' resolution.

    Raises:
        CameraError: There is no camera, or it is not a pinhole.
    """
    scene = depsgraph.scene_eval
    holder = scene.camera
    if holder is None or holder.type != "CAMERA":
        name = staged(depsgraph).name
        raise CameraError(f"scene {name!r} has no camera; add one and make it active")
    environment_from_world = inverse_of(world_from_environment(depsgraph))
    return camera_of(holder, scene.render, environment_from_world, picture_size)


def world_from_environment(depsgraph: bpy.types.Depsgraph) -> np.ndarray:
    """(4, 4) float64 matrix of the environment root at the evaluated frame; identity without one.

    Raises:
        CameraError: The root is mirrored or stretched, so that no rigid camera maps through it.
    """
    root = staged(depsgraph).playable_environment.root
    if root is None:
        return np.eye(4)
    matrix = np.array(root.evaluated_get(depsgraph).matrix_world, dtype=np.float64)
    axes = matrix[:3, :3]
    gram = axes.T @ axes
    size = float(np.trace(gram)) / 3
    stretched = np.abs(gram - size * np.eye(3)).max() > UNIFORM_SCALE_TOLERANCE * size
    if size <= 0 or stretched or np.linalg.det(axes) < 0:
        raise CameraError(
            f"environment root {root.name!r} is stretched or mirrored (scale "
            f"{[round(float(s), 4) for s in np.linalg.norm(axes, axis=0)]}); "
            "give it one positive scale for all axes"
        )
    return matrix


def staged(depsgraph: bpy.types.Depsgraph) -> bpy.types.Scene:
    """The scene whose environment an evaluated scene shows: a stand-in shows another one's."""
    return depsgraph.scene.playable_environment.stand_in_for or depsgraph.scene


def inverse_of(matrix: np.ndarray) -> np.ndarray:
    """Inverse of an affine (4, 4) float64 matrix, without the threads that LAPACK would wake."""
    x, y, z = matrix[:3, :3].T
    rows = np.cross((y, z, x), (z, x, y))
    rows /= rows[0] @ x
    inverse = np.eye(4)
    inverse[:3, :3], inverse[:3, 3] = rows, -(rows @ matrix[:3, 3])
    return inverse


def read_moment(depsgraph: bpy.types.Depsgraph) -> Moment:
    """Everything a frame asks for, from a dependency graph evaluated at that frame."""
    matrix = world_from_environment(depsgraph)
    tracks = read_tracks(depsgraph, matrix)
    return Moment(depsgraph.scene_eval.frame_current, read_camera(depsgraph), matrix, tracks)


def read_tracks(depsgraph: bpy.types.Depsgraph, matrix: np.ndarray) -> dict[str, TrackMoment]:
    """The playable objects at the evaluated frame, by their name in the model.

    Args:
        depsgraph: Evaluated at the frame that is meant.
        matrix: Of the environment root.

    Raises:
        ShotError: Two objects claim one name, one has none or is disabled in viewports.
    """
    environment_from_world = inverse_of(matrix)
    return {
        name: _read_track(each.evaluated_get(depsgraph), environment_from_world, depsgraph)
        for name, each in playable_objects(staged(depsgraph)).items()
    }


def sample_range(
    scene: bpy.types.Scene,
    frames: Iterable[int],
    on_frame: Callable[[int], None] | None = None,
) -> list[Moment]:
    """Read a scene at several frames; main thread only. The current frame is put back.

    Going through `frame_set` sees what keys, drivers, NLA and constraints make of the scene.

    Raises:
        ShotError: An object is disabled in viewports, so that its keys cannot be read.
    """
    before, subframe = scene.frame_current, scene.frame_subframe
    moments = []
    try:
        for frame in frames:
            scene.frame_set(frame)
            moments.append(read_moment(scene.view_layers[0].depsgraph))
            if on_frame:
                on_frame(frame)
    finally:
        scene.frame_set(before, subframe=subframe)
    return moments


def shot_from_moments(
    scene: bpy.types.Scene, start: Start, model: str, moments: Sequence[Moment]
) -> Shot:
    """The Shot that a sampled scene asks for; the model predicts all locations."""
    names = list(moments[0].tracks)
    return Shot(
        version=SHOT_VERSION,
        model=model,
        start=start,
        fps=frames_per_second(scene),
        frame_start=moments[0].frame,
        frame_end=moments[-1].frame,
        cameras=tuple(moment.camera for moment in moments),
        objects=tuple(_track_from_moments(name, moments) for name in names),
        quality=scene.playable_environment.quality,
        passes=wanted_passes(scene, scene.view_layers[0]),
    )


def wanted_passes(scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> tuple[str, ...]:
    """The Shot's passes that somebody has switched on.

    Depth is switched on in the view layer, masks and layers by object, the background in the scene.

    Raises:
        ShotError: Two objects claim one name, or one has none.
    """
    if scene.name in picture_only:
        return ()
    depth = [DEPTH_PASS] if layer.use_pass_z else []
    players = list(playable_objects(scene).items())
    masks = [f"{MASK_PASS_PREFIX}{name}" for name, each in players if each.playable.use_mask]
    layers = [f"{LAYER_PASS_PREFIX}{name}" for name, each in players if each.playable.use_layer]
    background = [BACKGROUND_PASS] if scene.playable_environment.use_background else []
    return (*depth, *masks, *layers, *background)


def frames_per_second(scene: bpy.types.Scene) -> float:
    """Scene pace; 29.97 is 30 / 1.001 in Blender's settings."""
    return scene.render.fps / scene.render.fps_base


def look_through(holder: bpy.types.Object, render: bpy.types.RenderSettings, eye: Camera) -> None:
    """Make a Blender camera and the resolution see what a pinhole camera sees.

    Args:
        holder: Camera object without parent; gets transform and lens.
        render: Gets resolution and pixel aspect.
        eye: The pinhole camera, in scene space.
    """
    fx, fy = float(eye.intrinsics[0, 0]), float(eye.intrinsics[1, 1])
    cx, cy = float(eye.intrinsics[0, 2]), float(eye.intrinsics[1, 2])
    render.resolution_x, render.resolution_y = eye.width, eye.height
    render.resolution_percentage = 100
    # Blender takes no pixel aspect below 1, so the larger side carries the ratio.
    render.pixel_aspect_x, render.pixel_aspect_y = max(fy / fx, 1.0), max(fx / fy, 1.0)
    lens = holder.data
    lens.type, lens.sensor_fit, lens.sensor_width = "PERSP", "HORIZONTAL", 36.0
    lens.lens = fx * lens.sensor_width / eye.width
    lens.shift_x = (eye.width / 2 - cx) / eye.width
    lens.shift_y = (cy - eye.height / 2) / (eye.width * fy / fx)
    world_from_blender_camera = eye.world_from_camera @ OPENCV_FROM_BLENDER_AXES
    holder.matrix_world = Matrix(world_from_blender_camera.tolist())


def _read_track(
    each: bpy.types.Object, environment_from_world: np.ndarray, depsgraph: bpy.types.Depsgraph
) -> TrackMoment:
    visible = each.is_evaluated and not each.hide_render
    if not each.is_evaluated and depsgraph.mode == "VIEWPORT":
        raise ShotError(
            f"{each.name!r} is disabled in viewports, so its keys cannot be read; enable it "
            "(the eye in the outliner may stay closed)"
        )
    environment_from_object = environment_from_world @ np.array(each.matrix_world, np.float64)
    location = tuple(float(x) for x in environment_from_object[:3, 3])
    heading = math.atan2(environment_from_object[1, 0], environment_from_object[0, 0])
    now = depsgraph.scene_eval.frame_current_final
    if not each.is_evaluated:
        return TrackMoment(None, location, visible, heading)
    override = read_override(each, staged(depsgraph), depsgraph.scene_eval.frame_current)
    return TrackMoment(_action_index(each, now), location, visible, heading, override)


def action_names(target: bpy.types.Object) -> list[str]:
    """The model's names for the actions of a playable object; the index is the action."""
    return json.loads(target.playable.action_names or "[]")


def _action_index(each: bpy.types.Object, frame: float) -> int | None:
    names = action_names(each)
    if not names:
        return None
    # Keys that do not hold would pass through the actions between two of them.
    held = held_value(each, ACTION_PATH, frame)
    identifier = each.playable.action if held is None else f"A{round(held)}"
    if not identifier or int(identifier.removeprefix("A")) >= len(names):
        raise ShotError(
            f"{each.name!r} has an action key beyond the model's {len(names)} actions "
            f"({', '.join(names)}); delete that key"
        )
    return int(identifier.removeprefix("A"))


def _track_from_moments(name: str, moments: Sequence[Moment]) -> ObjectTrack:
    keys: list[tuple[int, int]] = []
    for moment in moments:
        action = moment.tracks[name].action
        if action is not None and (not keys or keys[-1][1] != action):
            keys.append((moment.frame, action))
    visible = tuple(moment.tracks[name].visible for moment in moments)
    return ObjectTrack(name=name, actions=tuple(keys), visible=None if all(visible) else visible)
