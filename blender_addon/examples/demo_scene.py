"""Builds, bakes, films and cuts a scene from one picture, without a window.

    python -m blender_addon.examples.demo_scene --spec spec.json

Every step is the operator that a user would press. See `DemoSpec` for what the file holds; the
output folder gets frames/, demo.blend, demo.mp4 and blender_report.json.
"""

import argparse
import dataclasses
import json
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy
import numpy as np

import blender_addon
from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import PlayableEnvironmentError, ShotError

from .. import playables
from ..bake import bake_of
from ..complete_files import write_complete
from ..scene_bridge import action_names, look_through, playable_objects
from ..strips.job import job_for
from ..strips.video import write_video
from ..worker.session import session

KEYS_OF_A_MOVE = 5


@dataclass(frozen=True)
class DemoSpec:
    """What the spec file says.

    Attributes:
        image: Path of the picture.
        camera: The camera that saw it, as `Camera.as_dict` writes it.
        boxes: Per playable object left, top, right, bottom in the picture's pixels.
        model: Built-in name or checkpoint path.
        out: Output folder.
        width: Columns of the film.
        height: Rows of the film.
        frame_start: First frame.
        frame_end: Last frame, inclusive.
        fps: Frames per second.
        actions: Per playable object `[frame, action name]` keys.
        camera_move: `azimuth_degrees` around the players, counter-clockwise from above, and
            `dolly_metres`, the change of distance to them, both reached at the last frame.
        quality: exact, balanced or draft.
        worker: Command line of the worker; None for this Python's runtime.
    """

    image: str
    camera: Mapping[str, Any]
    boxes: Mapping[str, Sequence[float]]
    model: str
    out: str
    width: int
    height: int
    frame_start: int = 1
    frame_end: int = 24
    fps: int = 12
    actions: Mapping[str, Sequence[tuple[int, str]]] = field(default_factory=dict)
    camera_move: Mapping[str, float] = field(default_factory=dict)
    quality: str = "exact"
    worker: Sequence[str] | None = None


def read_spec(path: Path) -> DemoSpec:
    """Read a spec file.

    Raises:
        ShotError: It cannot be read, or a key is unknown or missing.
    """
    try:
        content = json.loads(path.read_text())
        return DemoSpec(**content)
    except (OSError, ValueError, TypeError) as error:
        known = ", ".join(each.name for each in dataclasses.fields(DemoSpec))
        raise ShotError(f"{path}: {error}; a spec has the keys {known}") from error


def film(spec: DemoSpec) -> dict[str, Any]:
    """Make everything the spec asks for and return the report.

    Raises:
        PlayableEnvironmentError: The spec, the picture, the model or the worker is at fault.
        RuntimeError: An operator stopped; its message says why.
    """
    out = Path(spec.out).resolve()
    out.mkdir(parents=True, exist_ok=True)
    clock = Stages()
    with clock.stage("scene"):
        scene = _empty_scene(spec, out)
    with clock.stage("encode"):
        bpy.ops.playable.new_environment(
            image=str(Path(spec.image).resolve()), model=spec.model, boxes=json.dumps(spec.boxes)
        )
        scene.playable_environment.quality = spec.quality
    with clock.stage("keys"):
        _key_actions(scene, spec.actions)
        _key_camera(scene, spec)
    with clock.stage("bake"):
        bpy.ops.playable.bake_paths()
    folder = str(out / "frames")
    with clock.stage("render"):
        bpy.ops.playable.render_to_sequencer(folder=folder)
    video = out / "demo.mp4"
    with clock.stage("video"):
        write_video(scene.playable_environment.edit_scene, video)
    with clock.stage("save"):
        bpy.ops.wm.save_as_mainfile(filepath=str(out / "demo.blend"))
    paths = bake_of(scene.playable_environment).paths
    return {
        "stages": clock.seconds,
        "frames": [str(file) for file in job_for(scene, folder).files],
        "paths": {name: path.tolist() for name, path in paths.items()},
        "video": str(video),
        "blend": str(out / "demo.blend"),
    }


class Stages:
    """Seconds per named stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time the block."""
        began = time.perf_counter()
        yield
        self.seconds[name] = round(time.perf_counter() - began, 3)


def _empty_scene(spec: DemoSpec, out: Path) -> bpy.types.Scene:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    blender_addon.register()
    if spec.worker:
        session.use_command(spec.worker)
    # Saved before anything is rendered, so that the strip's path is relative to the file.
    bpy.ops.wm.save_as_mainfile(filepath=str(out / "demo.blend"))
    scene = bpy.data.scenes[0]
    scene.frame_start, scene.frame_end = spec.frame_start, spec.frame_end
    scene.frame_set(spec.frame_start)
    scene.render.fps, scene.render.fps_base = spec.fps, 1.0
    holder = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(holder)
    scene.camera = holder
    eye = Camera.from_dict(spec.camera, "spec: camera")
    look_through(holder, scene.render, eye.scaled(spec.width, spec.height))
    return scene


def _key_actions(scene: bpy.types.Scene, actions: Mapping[str, Sequence[tuple[int, str]]]) -> None:
    objects = playable_objects(scene)
    for name, keys in actions.items():
        if name not in objects:
            raise ShotError(f"spec: actions: no {name!r} in the picture, only {list(objects)}")
        known = action_names(objects[name])
        for frame, action in keys:
            if action not in known:
                raise ShotError(
                    f"spec: actions: {name!r} has no action {action!r}; it has {', '.join(known)}"
                )
            playables.key_action(objects[name], frame, known.index(action))


def _key_camera(scene: bpy.types.Scene, spec: DemoSpec) -> None:
    """Key an arc around the players with a change of distance."""
    if unknown := set(spec.camera_move) - {"azimuth_degrees", "dolly_metres"}:
        raise ShotError(f"spec: camera_move has no {unknown.pop()!r}")
    azimuth = np.radians(spec.camera_move.get("azimuth_degrees", 0.0))
    dolly = spec.camera_move.get("dolly_metres", 0.0)
    holder = scene.camera
    holder.rotation_mode = "XYZ"
    standing = [np.array(each.location) for each in playable_objects(scene).values()]
    pivot = np.mean(standing, axis=0) if standing else np.zeros(3)
    arm, heading = np.array(holder.location) - pivot, holder.rotation_euler.z
    length = np.linalg.norm(arm)
    for share in np.linspace(0.0, 1.0, KEYS_OF_A_MOVE):
        angle, reach = share * azimuth, (length + share * dolly) / length
        turn = np.array(
            [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
        )
        holder.location = pivot + turn @ arm * reach
        # Turning about the world's Z adds to the last angle of the XYZ order.
        holder.rotation_euler.z = heading + angle
        frame = spec.frame_start + share * (spec.frame_end - spec.frame_start)
        for channel in ("location", "rotation_euler"):
            holder.keyframe_insert(channel, frame=frame)


def main(arguments: Sequence[str] | None = None) -> int:
    """Film the spec and write the report; returns the exit code, 1 after one clear message."""
    parser = argparse.ArgumentParser(prog="blender_addon.examples.demo_scene", description=__doc__)
    parser.add_argument("--spec", type=Path, required=True)
    spec_path = parser.parse_args(arguments).spec
    try:
        spec = read_spec(spec_path)
        _write_report(Path(spec.out) / "blender_report.json", film(spec))
    except (PlayableEnvironmentError, RuntimeError) as error:
        sys.stderr.write(f"demo scene: {str(error).strip()}\n")
        return 1
    finally:
        session.close()
    return 0


def _write_report(path: Path, report: dict[str, Any]) -> None:
    write_complete(path, json.dumps(report, indent=1).encode())


if __name__ == "__main__":
    code = main()
    sys.stderr.flush()
    # Blender 4.5 as a module can wait for ever in its own exit handlers.
    os._exit(code)
