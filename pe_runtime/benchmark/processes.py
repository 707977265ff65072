"""Jobs in processes of their own, so that peaks of memory and first frames belong to one point."""

import json
import subprocess
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path

import numpy as np

from pe_runtime.benchmark.jobs import Job, Measurement, Run, carry_out
from pe_runtime.benchmark.machine import Machine
from pe_runtime.config import as_dict, from_dict
from pe_runtime.contract.errors import PlayableEnvironmentError

JOB, RESULT, PICTURES = "job.json", "result.json", "pictures.npz"


class BenchmarkError(PlayableEnvironmentError):
    """A measuring process failed; the message has its last words."""


def measure(job: Job) -> Measurement:
    """Carry a job out in a fresh Python.

    Raises:
        BenchmarkError: It failed.
    """
    with tempfile.TemporaryDirectory(prefix="pe_bench_") as folder:
        Path(folder, JOB).write_text(json.dumps(as_dict(job)))
        command = [sys.executable, "-m", "pe_runtime.benchmark", folder]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            said = " | ".join(done.stderr.strip().splitlines()[-3:]) or "(nothing)"
            raise BenchmarkError(f"measuring {job.model} failed; its last words: {said}")
        return _read(Path(folder))


def carry_out_in(folder: Path) -> None:
    """What the fresh Python does: read the job, do it, write what came out."""
    job = from_dict(Job, json.loads((folder / JOB).read_text()), str(folder / JOB))
    found = carry_out(job)
    np.savez(folder / PICTURES, **found.pictures)
    plain = {
        "machine": asdict(found.machine),
        "loaded_memory": found.loaded_memory,
        "gpu_memory": found.gpu_memory,
        "cold_seconds": found.cold_seconds,
        "runs": [asdict(run) for run in found.runs],
    }
    (folder / RESULT).write_text(json.dumps(plain))


def _read(folder: Path) -> Measurement:
    plain = json.loads((folder / RESULT).read_text())
    with np.load(folder / PICTURES) as stored:
        pictures = {key: stored[key] for key in stored.files}
    runs = tuple(
        Run(each["case"], tuple(each["seconds"]), tuple(each["memory"]), each["statistics"])
        for each in plain["runs"]
    )
    return Measurement(
        Machine(**plain["machine"]),
        plain["loaded_memory"],
        plain["gpu_memory"],
        plain["cold_seconds"],
        runs,
        pictures,
    )
