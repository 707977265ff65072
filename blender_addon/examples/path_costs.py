"""Times what Blender adds to the worker's drawing, frame by frame and part by part.

    python -m blender_addon.examples.path_costs --spec spec.json

Opens a picture, bakes, and draws it as F12 does and as a range to files, with the picture alone
and with all passes. See `CostSpec` for what the file holds; the samples go to `out`.
"""

import argparse
import dataclasses
import json
import os
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

import bpy

import blender_addon
from pe_runtime.contract.camera import Camera

from ..filming import engine
from ..filming.pixels import PassMemory
from ..scene_bridge import look_through, picture_only, playable_objects
from ..strips.job import job_for
from ..strips.lending import lent_settings
from ..worker.session import session

WARM_UP = 2
"""Frames at the start of each way that are not counted: files and memory are first touched."""
FPS = 10
CONVERSIONS = ("combined", "values", "depth")
PARTS = ("evaluate", "request", "pipe", "conversion", "result", "save")
"""Scene and render result made ready; moment read and asked for; worker's bytes on their way beyond
its drawing; bytes to Blender's numbers; numbers into the result; colours, file and the rest."""


@dataclass(frozen=True)
class CostSpec:
    """What the spec file says.

    Attributes:
        image: Path of the picture.
        camera: The camera that saw it, as `Camera.as_dict` writes it; its size is the film's.
        boxes: Per playable object left, top, right, bottom in the picture's pixels.
        model: Built-in name or checkpoint path.
        quality: exact, balanced or draft.
        frames: Frames of each way.
        worker: Command line of the worker.
        folder: For the rendered files.
        out: The report, a JSON file.
    """

    image: str
    camera: Mapping[str, Any]
    boxes: Mapping[str, Sequence[float]]
    model: str
    quality: str
    frames: int
    worker: Sequence[str]
    folder: str
    out: str


class FrameClock:
    """Splits the wall time of frames into `PARTS`, by the moments at which one ends.

    Attributes:
        samples: Per counted frame the seconds of every part, of `drawing` and of the `wall`.
    """

    def __init__(self) -> None:
        self.samples: list[dict[str, float]] = []
        self._spans: defaultdict[str, float] = defaultdict(float)
        self._began = self._left = 0.0

    def begin(self) -> None:
        """A frame begins: Blender is about to evaluate the scene."""
        self._began = time.perf_counter()
        self._spans.clear()

    def end(self, *_: object) -> None:
        """The frame is done; the next one begins."""
        now, spans = time.perf_counter(), self._spans
        held = spans["asked"] + spans["handed"]
        self.samples.append(
            {
                "evaluate": spans["entered"] - self._began,
                "request": spans["inside"] - held,
                "pipe": spans["asked"] - spans["drawing"],
                "conversion": spans["converted"],
                "result": spans["handed"] - spans["converted"],
                "save": now - self._left,
                "drawing": spans["drawing"],
                "wall": now - self._began,
            }
        )
        self.begin()

    def note_drawing(self, seconds: float) -> None:
        """The worker has said how long it drew."""
        self._spans["drawing"] += seconds

    def entering(self, work: Callable) -> Callable:
        """The engine's way in and out."""

        # Blender counts the arguments of a method, so they are spelt out.
        def timed(self_: object, depsgraph: object) -> None:
            began = self._spans["entered"] = time.perf_counter()
            work(self_, depsgraph)
            self._left = time.perf_counter()
            self._spans["inside"] += self._left - began

        return timed

    def counting(self, name: str, work: Callable) -> Callable:
        """A call whose time counts under a name."""

        def timed(*arguments: object) -> object:
            began = time.perf_counter()
            result = work(*arguments)
            self._spans[name] += time.perf_counter() - began
            return result

        return timed


@contextmanager
def clocked() -> Iterator[FrameClock]:
    """A clock on the engine's own functions, for as long as the block runs."""
    clock, kind = FrameClock(), engine.PlayableEnvironmentEngine
    ask = clock.counting("asked", session.render)

    def asked(*arguments: object) -> object:
        drawn = ask(*arguments)
        clock.note_drawing(drawn.seconds)
        return drawn

    timed = (
        (kind, "render", clock.entering(kind.render)),
        (kind, "_hand_over", clock.counting("handed", kind._hand_over)),
        *(
            (PassMemory, n, clock.counting("converted", getattr(PassMemory, n)))
            for n in CONVERSIONS
        ),
        (session, "render", asked),
    )
    with ExitStack() as stack:
        for owner, name, replacement in timed:
            stack.enter_context(mock.patch.object(owner, name, replacement))
        yield clock


def measure(spec: CostSpec) -> dict[str, Any]:
    """Open, bake and draw in every way.

    Returns:
        The ways' samples, and Blender's version.

    Raises:
        RuntimeError: An operator stopped; its message says why.
    """
    scene = _open_scene(spec)
    ways: list[dict[str, Any]] = []
    for with_passes in (False, True):
        scene.view_layers[0].use_pass_z = with_passes
        for each in playable_objects(scene).values():
            each.playable.use_mask = with_passes
        passes = ["depth", *(f"mask:{n}" for n in playable_objects(scene))] if with_passes else []
        for way, draw in (("still", _draw_stills), ("range", _draw_range)):
            _move_camera(scene, len(ways))
            bpy.ops.playable.bake_paths()
            with clocked() as clock:
                draw(scene, spec, clock)
            if len(clock.samples) != spec.frames + WARM_UP or not clock.samples[-1]["drawing"]:
                raise RuntimeError(f"{len(clock.samples)} frames were timed, not all were drawn")
            ways.append({"way": way, "passes": passes, "samples": clock.samples[WARM_UP:]})
    return {"blender": bpy.app.version_string, "ways": ways}


def _open_scene(spec: CostSpec) -> bpy.types.Scene:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    blender_addon.register()
    session.use_command(spec.worker)
    scene = bpy.data.scenes[0]
    scene.frame_start, scene.frame_end = 1, spec.frames + WARM_UP
    scene.frame_set(1)
    scene.render.fps = FPS
    holder = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(holder)
    scene.camera = holder
    look_through(holder, scene.render, Camera.from_dict(spec.camera, "spec: camera"))
    bpy.ops.playable.new_environment(
        image=spec.image, model=spec.model, boxes=json.dumps(spec.boxes)
    )
    scene.playable_environment.quality = spec.quality
    return scene


def _move_camera(scene: bpy.types.Scene, way: int) -> None:
    """Let the camera travel, each way higher: a picture that was drawn before costs no drawing."""
    scene.frame_set(1)
    x, y, z = scene.camera.location
    for frame, ahead in ((1, 0.0), (scene.frame_end, 0.5)):
        scene.camera.location = x + ahead, y, z + 0.01 * bool(way)
        scene.camera.keyframe_insert("location", frame=frame)


def _draw_stills(scene: bpy.types.Scene, spec: CostSpec, clock: FrameClock) -> None:
    for frame in range(1, spec.frames + WARM_UP + 1):
        scene.frame_set(frame)
        clock.begin()
        bpy.ops.render.render(scene=scene.name)
        clock.end()


def _draw_range(scene: bpy.types.Scene, spec: CostSpec, clock: FrameClock) -> None:
    job, written = job_for(scene, spec.folder), bpy.app.handlers.render_write
    with lent_settings(scene, job):
        # As where compositor nodes use the passes: those that are switched on are drawn.
        picture_only.discard(scene.name)
        written.append(clock.end)
        try:
            clock.begin()
            bpy.ops.render.render(animation=True, scene=scene.name)
        finally:
            written.remove(clock.end)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure what the spec asks for; returns the exit code, 1 after one clear message."""
    parser = argparse.ArgumentParser(prog="blender_addon.examples.path_costs", description=__doc__)
    parser.add_argument("--spec", type=Path, required=True)
    path = parser.parse_args(arguments).spec
    try:
        spec = CostSpec(**json.loads(path.read_text()))
        Path(spec.out).write_text(json.dumps(measure(spec), indent=1))
    except (RuntimeError, OSError, ValueError, TypeError) as error:
        known = ", ".join(each.name for each in dataclasses.fields(CostSpec))
        sys.stderr.write(f"path costs: {str(error).strip()} (a spec has the keys {known})\n")
        return 1
    finally:
        session.close()
    return 0


if __name__ == "__main__":
    code = main()
    sys.stderr.flush()
    # Blender 4.5 as a module can wait for ever in its own exit handlers.
    os._exit(code)
