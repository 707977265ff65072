"""What was measured on: processor, threads, and how fast one plain product is there right now."""

import os
import platform
import time
from dataclasses import dataclass
from pathlib import Path

import torch

ROWS, WIDTH = 200_000, 256
"""The product by which machines are compared: ROWS x WIDTH times WIDTH x WIDTH."""
STATUS = Path("/proc/self/status")
PROCESSOR = Path("/proc/cpuinfo")


@dataclass(frozen=True)
class Machine:
    """Where a point was measured.

    Attributes:
        processor: Its name; of the GPU where networks ran there.
        cores: Cores that this process may use.
        threads: Threads of torch.
        bfloat16: Instructions for bfloat16 products: "amx", "avx512_bf16", "cuda" or "none".
        torch: Version.
        gflops_float32: Rate of the product in float32, 10^9 operations a second.
        gflops_bfloat16: Rate of the product in bfloat16.
        load: Processes that wanted to run in the last minute, ours among them; None if unknown.
    """

    processor: str
    cores: int
    threads: int
    bfloat16: str
    torch: str
    gflops_float32: float
    gflops_bfloat16: float
    load: float | None


def describe_machine(device: str, rows: int = ROWS) -> Machine:
    """Look at the machine and time the product on it."""
    load = round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else None
    affinity = getattr(os, "sched_getaffinity", None)
    return Machine(
        _processor(device),
        len(affinity(0)) if affinity else os.cpu_count() or 1,
        torch.get_num_threads(),
        _bfloat16(device),
        torch.__version__,
        round(product_rate(torch.float32, device, rows), 1),
        round(product_rate(torch.bfloat16, device, rows), 1),
        load,
    )


def product_rate(dtype: torch.dtype, device: str, rows: int = ROWS) -> float:
    """10^9 operations a second of a (rows x 256) (256 x 256) product: the best of three."""
    left = torch.ones(rows, WIDTH, dtype=dtype, device=device)
    right = torch.ones(WIDTH, WIDTH, dtype=dtype, device=device)
    seconds = []
    # The first product in a process also chooses its kernel.
    for _ in range(4):
        began = time.perf_counter()
        (left @ right)[0, 0].item()
        seconds.append(time.perf_counter() - began)
    return 2.0 * rows * WIDTH * WIDTH / min(seconds[1:]) / 1e9


def peak_memory() -> float | None:
    """Most memory that this process ever held, in MiB (VmHWM); None where /proc does not say."""
    if not STATUS.is_file():
        return None
    lines = dict(line.split(":", 1) for line in STATUS.read_text().splitlines() if ":" in line)
    return int(lines["VmHWM"].split()[0]) / 1024


def peak_gpu_memory(device: str) -> float | None:
    """Most memory that tensors of this process ever held on a GPU, in MiB; None on the CPU."""
    if not device.startswith("cuda"):
        return None
    return torch.cuda.max_memory_allocated(device) / (1 << 20)


def _processor(device: str) -> str:
    if device.startswith("cuda"):
        return torch.cuda.get_device_name(device)
    if PROCESSOR.is_file():
        for line in PROCESSOR.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def _bfloat16(device: str) -> str:
    if device.startswith("cuda"):
        return "cuda" if torch.cuda.is_bf16_supported() else "none"
    known = (
        ("amx", "_is_amx_tile_supported"),
        ("avx512_bf16", "_is_avx512_bf16_supported"),
    )
    # Private to torch, so a version without them is no reason to fail.
    found = [name for name, ask in known if getattr(torch.cpu, ask, bool)()]
    return found[0] if found else "none"
