"""One measurement: films of a model drawn frame by frame, each frame timed, in one process."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

from pe_runtime.benchmark.machine import (
    ROWS,
    Machine,
    describe_machine,
    peak_gpu_memory,
    peak_memory,
)
from pe_runtime.benchmark.motion import film
from pe_runtime.benchmark.scenes import Scene, open_scene
from pe_runtime.benchmark.timing import interleaved
from pe_runtime.benchmark.variations import resized, with_cast, with_samples
from pe_runtime.config import Quality
from pe_runtime.contract.camera import Camera
from pe_runtime.environment import PlayableEnvironment, RenderOptions
from pe_runtime.geometry.cameras import Cameras
from pe_runtime.kept_frames import Frame
from pe_runtime.rendering.scene import RenderSettings
from pe_runtime.state import EnvironmentState


@dataclass(frozen=True)
class Case:
    """One film of one variation of the scene."""

    name: str
    quality: Quality = Quality()
    film: str = "moving"
    """A key of `motion.FILMS`."""
    frames: int = 2
    width: int = 0
    """Pixels; 0 for the scene's own."""
    height: int = 0
    samples: float = 1.0
    """Times as many samples."""
    cast: str = "as found"
    """One of `variations.CASTS`."""
    count: int = 0
    """How many more players."""
    kept: tuple[int, ...] = ()
    """Frames whose pictures are wanted."""
    plain: bool = False
    """Drawn by the model's modules as in training, not by the frame renderer."""


@dataclass(frozen=True)
class Job:
    """What one process measures."""

    model: str
    start: str | None
    """Clip or state file."""
    device: str
    cases: tuple[Case, ...]
    rounds: int = 1
    product_rows: int = ROWS
    """Rows of the product that tells how fast the machine is; fewer where a test is in a hurry."""


@dataclass(frozen=True)
class Run:
    """One film drawn once, with nothing kept from before.

    Attributes:
        case: Its name.
        seconds: Of each frame.
        memory: Peak of the process after each frame, MiB; empty where unknown.
        statistics: The renderer's counters of the last frame.
    """

    case: str
    seconds: tuple[float, ...]
    memory: tuple[float, ...]
    statistics: Mapping[str, int]


@dataclass(frozen=True)
class Measurement:
    """What one process found out.

    Attributes:
        machine: Where; the product was timed right after the films.
        loaded_memory: Peak before anything was drawn, MiB; None where unknown.
        gpu_memory: Peak of tensors on the GPU, MiB; None on the CPU.
        cold_seconds: The very first frame of the process, which also chooses kernels.
        runs: In the order in which they were drawn.
        pictures: "case/frame" -> (height, width, 3) sRGB, of the first round.
    """

    machine: Machine
    loaded_memory: float | None
    gpu_memory: float | None
    cold_seconds: float
    runs: tuple[Run, ...]
    pictures: Mapping[str, np.ndarray]


def carry_out(job: Job) -> Measurement:
    """Do the job in this process.

    Raises:
        PlayableEnvironmentError: The model, its start or a case is at fault.
    """
    scene = open_scene(job.model, None if job.start is None else Path(job.start), job.device)
    loaded = peak_memory()
    scenes = {case.name: vary(scene, case) for case in job.cases}
    # Each size and quality once beforehand: the first also pays for what a process does once.
    cold = [_draw(scenes[each.name], replace(each, frames=1), {})[0].seconds for each in job.cases]
    pictures: dict[str, np.ndarray] = {}
    runs = []
    for case in interleaved(job.cases, job.rounds):
        run, seen = _draw(scenes[case.name], case, pictures)
        pictures |= seen
        runs.append(run)
    kind = scene.environment.device.type
    # Before the product, whose operands are larger than many a model.
    on_gpu = peak_gpu_memory(kind)
    machine = describe_machine(kind, job.product_rows)
    return Measurement(machine, loaded, on_gpu, cold[0][0], tuple(runs), pictures)


def vary(scene: Scene, case: Case) -> Scene:
    """The variation that a case asks for."""
    if case.width:
        scene = resized(scene, case.width, case.height)
    if case.samples != 1.0:
        scene = with_samples(scene, case.samples)
    if case.cast != "as found":
        scene = with_cast(scene, case.cast, case.count)
    return scene


def _draw(
    scene: Scene, case: Case, known: Mapping[str, np.ndarray]
) -> tuple[Run, dict[str, np.ndarray]]:
    """Draw a film in an environment that remembers nothing; pictures that are not yet known."""
    own = scene.environment
    environment = PlayableEnvironment(own.config, own.networks, own.actions, own.header)
    options = RenderOptions(quality=case.quality)
    draw = draw_plainly if case.plain else PlayableEnvironment.render
    seconds, memory, pictures, statistics = [], [], {}, {}
    for number, (state, camera) in enumerate(film(scene, case.film, case.frames)):
        began = time.perf_counter()
        frame = draw(environment, state, camera, options)
        seconds.append(time.perf_counter() - began)
        memory.append(peak_memory())
        statistics = frame.statistics
        key = f"{case.name}/{number}"
        if number in case.kept and key not in known:
            pictures[key] = frame.rgb
    peaks = tuple(each for each in memory if each is not None)
    return Run(case.name, tuple(seconds), peaks, dict(statistics)), pictures


@torch.no_grad()
def draw_plainly(
    environment: PlayableEnvironment,
    state: EnvironmentState,
    camera: Camera,
    options: RenderOptions,
) -> Frame:
    """Draw a frame with the model's modules as training does; of the options nothing counts."""
    del options
    cameras = Cameras.stack([camera], environment.device)
    size = environment.renderer.map_size(cameras)
    corner = torch.zeros(1, 2, dtype=torch.long)
    settings = RenderSettings(near=environment.config.near)
    codes, networks = environment.codes(state), environment.networks
    picture = networks.synthesise(cameras, codes, corner, size, settings)[0]
    picture = picture[:, : camera.height, : camera.width].permute(1, 2, 0)
    return Frame(np.ascontiguousarray(picture.cpu().numpy()))
