"""Record a scene with marked playable objects as one episode on disk."""

import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
import OpenImageIO

from blender_addon.datagen import passes
from blender_addon.datagen.recordable import ACTION, UNKNOWN_ACTION, Recordable
from pe_runtime.contract.camera import BlenderLens, Camera, camera_from_blender
from pe_runtime.contract.episode import (
    EPISODE_FILE,
    DatasetInfo,
    EpisodeArrays,
    frame_path,
    mask_path,
    write_depth,
    write_episode,
)
from pe_runtime.contract.errors import EpisodeError

SMALLEST_VISIBLE = 12  # pixels; below this an object has no box


@dataclass(frozen=True)
class Recording:
    """How to record: picture size in pixels, number of views, Cycles samples per ray."""

    width: int
    height: int
    views: int
    samples: int = 1


def dataset_info(source: Recordable, recording: Recording, seed: int, count: int) -> DatasetInfo:
    """The facts every episode of this source shares."""
    return DatasetInfo(
        scene=source.name,
        seed=seed,
        count=count,
        steps_per_second=source.steps_per_second,
        width=recording.width,
        height=recording.height,
        objects=tuple(source.playables()),
        actions=source.actions,
        views=recording.views,
    )


def record_episode(
    source: Recordable, recording: Recording, info: DatasetInfo, path: Path, metadata: dict
) -> None:
    """Render every frame and view of `source` into the episode folder `path`.

    What an interrupted run left there is removed first.

    Raises:
        EpisodeError: If the scene lacks a camera, or Blender failed to render.
        CameraError: If a camera is not a pinhole.
    """
    if path.exists():
        (path / EPISODE_FILE).unlink(missing_ok=True)
        shutil.rmtree(path)
    cameras = source.cameras(recording.views)
    roots = source.playables()
    _index_parts(source.scene, list(roots.values()))
    arrays = _empty_arrays(recording.views, len(source.frames), len(roots))
    scene = source.scene
    with tempfile.TemporaryDirectory(prefix="pe_datagen_") as folder:
        raw = Path(folder) / "raw.exr"
        passes.prepare(scene, recording.width, recording.height, recording.samples, raw)
        for t, frame in enumerate(source.frames):
            scene.frame_set(frame)
            _note_objects(arrays, t, list(roots.values()))
            for view, camera in enumerate(cameras):
                seen = pinhole(scene, camera, recording)
                arrays["intrinsics"][view, t] = seen.intrinsics
                arrays["world_from_camera"][view, t] = seen.world_from_camera
                picture = passes.render(scene, camera)
                boxes = tight_boxes(picture.ids, len(roots))
                arrays["boxes"][view, t] = boxes
                arrays["present"][view, t] = np.isfinite(boxes).all(-1)
                _write_picture(path, view, t, picture)
    scene.camera = cameras[0]
    write_episode(path, info, EpisodeArrays(**arrays), metadata)


def pinhole(scene: bpy.types.Scene, camera: bpy.types.Object, recording: Recording) -> Camera:
    """The evaluated camera at the current frame, on the recording's pixel grid."""
    evaluated = camera.evaluated_get(bpy.context.evaluated_depsgraph_get())
    lens = evaluated.data
    numbers = BlenderLens(
        type=lens.type,
        lens=lens.lens,
        sensor_width=lens.sensor_width,
        sensor_height=lens.sensor_height,
        sensor_fit=lens.sensor_fit,
        shift_x=lens.shift_x,
        shift_y=lens.shift_y,
        resolution_x=recording.width,
        resolution_y=recording.height,
        resolution_percentage=100,
        pixel_aspect_x=scene.render.pixel_aspect_x,
        pixel_aspect_y=scene.render.pixel_aspect_y,
    )
    return camera_from_blender(numbers, np.array(evaluated.matrix_world))


def tight_boxes(ids: np.ndarray, count: int) -> np.ndarray:
    """The smallest box around each object's pixels.

    Args:
        ids: (height, width) 0 nothing, k + 1 = object k.
        count: Number of objects.

    Returns:
        (count, 4) float32 left, top, right, bottom as pixel edges; NaN where fewer than
        `SMALLEST_VISIBLE` pixels are seen.
    """
    boxes = np.full((count, 4), np.nan, dtype=np.float32)
    for k in range(count):
        rows, columns = np.nonzero(ids == k + 1)
        if len(rows) >= SMALLEST_VISIBLE:
            boxes[k] = columns.min(), rows.min(), columns.max() + 1, rows.max() + 1
    return boxes


def write_png(path: Path, pixels: np.ndarray) -> None:
    """Write 8-bit pixels, (height, width) or (height, width, 3), unchanged.

    Raises:
        EpisodeError: If the file cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    # Three axes always: two would be taken for a row of multi-channel pixels.
    pixels = np.ascontiguousarray(pixels.reshape(*pixels.shape[:2], -1))
    height, width, channels = pixels.shape
    spec = OpenImageIO.ImageSpec(width, height, channels, "uint8")
    output = OpenImageIO.ImageOutput.create(str(path))
    written = output is not None and output.open(str(path), spec) and output.write_image(pixels)
    if not written or not output.close():
        reason = output.geterror() if output is not None else OpenImageIO.geterror()
        raise EpisodeError(f"{path} cannot be written: {reason}; is the disk full?")


def _empty_arrays(views: int, frames: int, objects: int) -> dict[str, np.ndarray]:
    return {
        "intrinsics": np.zeros((views, frames, 3, 3)),
        "world_from_camera": np.zeros((views, frames, 4, 4)),
        "boxes": np.zeros((views, frames, objects, 4), dtype=np.float32),
        "present": np.zeros((views, frames, objects), dtype=bool),
        "positions": np.zeros((frames, objects, 3)),
        "actions": np.full((max(frames - 1, 0), objects), UNKNOWN_ACTION, dtype=np.int8),
    }


def _index_parts(scene: bpy.types.Scene, roots: list[bpy.types.Object]) -> None:
    """Number every object by the playable object it belongs to; 0 for everything else."""
    for other in scene.objects:
        other.pass_index = 0
    for number, root in enumerate(roots, start=1):
        for part in (root, *root.children_recursive):
            part.pass_index = number


def _note_objects(arrays: dict, t: int, roots: list[bpy.types.Object]) -> None:
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for k, root in enumerate(roots):
        evaluated = root.evaluated_get(depsgraph)
        arrays["positions"][t, k] = evaluated.matrix_world.translation
        if t < len(arrays["actions"]) and ACTION in evaluated.keys():
            arrays["actions"][t, k] = int(evaluated[ACTION])


def _write_picture(path: Path, view: int, t: int, picture: passes.Picture) -> None:
    write_png(frame_path(path, view, t), picture.colour)
    write_png(mask_path(path, view, t), picture.ids)
    write_depth(path, view, t, picture.depth)
