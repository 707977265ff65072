"""A whole benchmark: every section of every model, as one JSON-able report."""

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import torch

import pe_runtime
from pe_runtime.benchmark.blender_path import PathJob, blender_path_section
from pe_runtime.benchmark.costs import (
    measure_frames,
    measure_objects,
    measure_pixels,
    measure_samples,
)
from pe_runtime.benchmark.jobs import Job, Measurement
from pe_runtime.benchmark.machine import describe_machine
from pe_runtime.benchmark.plan import BLENDER, OF_MODELS, SECTIONS, Bench, Plan, name_of
from pe_runtime.benchmark.points import all_points
from pe_runtime.benchmark.processes import measure
from pe_runtime.benchmark.quality_points import measure_points
from pe_runtime.benchmark.scenes import Scene, open_scene, store_scene
from pe_runtime.benchmark.variations import resized
from pe_runtime.contract.errors import ConfigError

BLENDER_FRAMES = 8
"""Frames of each way through Blender, per repeat."""
FORMAT = 1
"""Version of the report; docs/benchmark.md describes it."""

MEASURES: Mapping[str, Callable[[Bench], Any]] = {
    "points": measure_points,
    "pixels": measure_pixels,
    "objects": measure_objects,
    "samples": measure_samples,
    "frames": measure_frames,
}


def run_benchmark(
    plan: Plan,
    on_progress: Callable[[int, int], object] = lambda done, total: None,
    by: Callable[[Job], Measurement] = measure,
) -> dict[str, Any]:
    """Measure everything that is planned.

    Args:
        plan: What, and how thoroughly.
        on_progress: Called with processes done and their number.
        by: Carries out jobs.

    Raises:
        ConfigError: A section is unknown.
        PlayableEnvironmentError: A model or its start is at fault.
    """
    unknown = [name for name in plan.sections if name not in SECTIONS]
    if unknown:
        raise ConfigError(f"no section {unknown[0]!r}; there are: {', '.join(SECTIONS)}")
    plan = replace(plan, device=_resolved(plan.device))
    total, done = sum(plan_steps(plan)[name] for name in plan.sections), 0

    def step() -> None:
        nonlocal done
        done += 1
        on_progress(done, total)

    on_progress(0, total)
    machine = asdict(describe_machine(plan.device, plan.product_rows))
    models = []
    with tempfile.TemporaryDirectory(prefix="pe_bench_") as folder:
        for number, model in enumerate(plan.models):
            scene = _opened(plan, model)
            start = Path(folder, f"start_{number}.json")
            store_scene(scene, start)
            bench = Bench(plan, model, scene, str(start), by, step)
            sections = {name: MEASURES[name](bench) for name in OF_MODELS if name in plan.sections}
            models.append(_about(model, scene) | sections)
    found = {
        "format": FORMAT,
        "version": pe_runtime.__version__,
        "plan": plan.as_dict(),
        "machine": machine,
        "models": models,
    }
    if BLENDER in plan.sections:
        found[BLENDER] = blender_path_section(PathJob(frames=BLENDER_FRAMES * plan.repeats))
        step()
    return found


def plan_steps(plan: Plan) -> dict[str, int]:
    """How many processes each section starts, for all models together."""
    points = len(all_points(switches=plan.switches)) * plan.repeats
    steps = dict.fromkeys(OF_MODELS, 1) | {"points": points, "frames": 2}
    return {name: len(plan.models) * count for name, count in steps.items()} | {BLENDER: 1}


def _resolved(device: str) -> str:
    return ("cuda" if torch.cuda.is_available() else "cpu") if device == "auto" else device


def _opened(plan: Plan, model: str) -> Scene:
    scene = open_scene(model, plan.start, plan.device)
    if plan.shrink == 1:
        return scene
    camera = scene.camera
    return resized(scene, camera.width // plan.shrink, camera.height // plan.shrink)


def _about(model: str, scene: Scene) -> dict[str, Any]:
    config = scene.environment.config
    return {
        "model": name_of(model),
        "name": config.name,
        "width": scene.camera.width,
        "height": scene.camera.height,
        "quadrature": config.quadrature,
        "object_count": len(config.objects),
        "player_count": len(config.playable_names),
    }
