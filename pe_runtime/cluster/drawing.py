"""A worker's part: load the model once, draw runs of frames, encode them as files."""

import ctypes
import os
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import torch

from pe_runtime import __version__
from pe_runtime.cluster.model_copies import find_copy
from pe_runtime.cluster.parcels import Answer, Files, FrameOrder, Job, unpack
from pe_runtime.contract.errors import ClusterError
from pe_runtime.environment import PlayableEnvironment, RenderOptions
from pe_runtime.shots.files import frame_path, write_frame
from pe_runtime.shots.frames import RENDERER_VERSION

TRIM_REQUEST = "MALLOC_TRIM_THRESHOLD_"
KEPT_MEMORY = {-1: 64 << 20, -3: 32 << 20}
"""M_TRIM_THRESHOLD and M_MMAP_THRESHOLD in bytes, as high as glibc itself lets them grow."""
# Of all threads of a worker one draws at a time, with the threads of all: a model remembers its
# last frame.
_drawing = threading.Lock()
_worlds: dict[tuple[str, str], PlayableEnvironment] = {}


@dataclass(frozen=True)
class Workplace:
    """Where a worker draws."""

    address: str
    folder: str
    """Its own; goes when it goes."""
    threads: int
    """How many it may use."""


def versions() -> dict[str, str]:
    """The programs whose arithmetic decides the pixels."""
    return {
        "playable-environments": __version__,
        "its renderer": str(RENDERER_VERSION),
        "torch": torch.__version__.partition("+")[0],
    }


def endings(job: Job) -> tuple[str, ...]:
    """Files of a frame, in the order in which they are put in place."""
    passes = job.depth or job.masks or job.layers or job.background
    return (".exr", ".png") if passes else (".png",)


def draw(parcel: bytes, place: Workplace) -> Answer:
    """Draw frames until all are done, one fails, or the job's time is up; one at least.

    Args:
        parcel: What `parcels.pack` wrote.
        place: Where this happens.
    """
    job, orders = unpack(parcel)
    drawn: dict[int, Files] = {}
    number = orders[0].number
    try:
        _check_versions(job)
        with _drawing:
            world = _world(job, place)
            if world is None:
                return Answer(place.address, needs_model=True)
            _use_threads(job.threads or place.threads)
            began = time.monotonic()
            for order in orders:
                number = order.number
                drawn[number] = _draw_frame(world, job, order)
                if time.monotonic() - began > job.seconds:
                    break
    except Exception as error:  # noqa: BLE001 whatever it is, the client must hear which frame
        return Answer(place.address, drawn, number, f"{type(error).__name__}: {error}")
    return Answer(place.address, drawn)


def _draw_frame(world: PlayableEnvironment, job: Job, order: FrameOrder) -> Files:
    options = RenderOptions(
        job.quality, job.depth, job.masks, job.region, job.layers, job.background
    )
    frame = world.render(order.state, order.camera, options)
    # Through files, since that is what a single machine would write, to the byte.
    with tempfile.TemporaryDirectory() as folder:
        write_frame(Path(folder), order.number, frame, order.digest)
        path = frame_path(Path(folder), order.number)
        return {ending: path.with_suffix(ending).read_bytes() for ending in endings(job)}


def _world(job: Job, place: Workplace) -> PlayableEnvironment | None:
    """The job's model, kept until another is asked for; None without its file."""
    key = (job.model_digest, job.device)
    if key not in _worlds:
        file = find_copy(job, Path(place.folder))
        if file is None:
            return None
        _keep_freed_memory()
        _worlds.clear()
        _worlds[key] = PlayableEnvironment.load(file, job.device)
    return _worlds[key]


def _keep_freed_memory() -> None:
    """Undo what Dask asks of its workers' allocator: to give memory back at once.

    A renderer asks for the same again right after, and would spend most of its time on that.
    """
    if sys.platform != "linux" or TRIM_REQUEST not in os.environ:
        return
    adjust = getattr(ctypes.CDLL(None), "mallopt", None)  # glibc has it, others need not
    for parameter, value in KEPT_MEMORY.items():
        if adjust is not None:
            adjust(parameter, value)


def _use_threads(count: int) -> None:
    if torch.get_num_threads() != count:
        torch.set_num_threads(count)


def _check_versions(job: Job) -> None:
    own = versions()
    other = [
        f"{name} {own.get(name)} instead of {version}"
        for name, version in job.versions.items()
        if own.get(name) != version
    ]
    if other:
        raise ClusterError(f"this worker has {', '.join(other)}; install the client's versions")
