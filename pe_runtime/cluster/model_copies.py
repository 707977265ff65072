"""The model's file in a worker: the client's path if it holds the same bytes, else a copy sent."""

import hashlib
from pathlib import Path

from distributed import Worker, WorkerPlugin

from pe_runtime.cluster.parcels import Job


def file_digest(path: Path) -> str:
    """SHA-256 of a file, in hex."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def find_copy(job: Job, folder: Path) -> Path | None:
    """A file here with the very bytes of the job's model.

    Args:
        job: Path and digest of the model.
        folder: Where this worker keeps files that were sent to it.
    """
    for path in (Path(job.model), _copy_path(folder, job.model_digest)):
        if path.is_file() and file_digest(path) == job.model_digest:
            return path
    return None


def keep_copy(content: bytes, digest: str, folder: Path) -> None:
    """Put a model's file where `find_copy` looks for it, whole or not at all."""
    path = _copy_path(folder, digest)
    unfinished = path.with_suffix(".part")
    unfinished.write_bytes(content)
    unfinished.replace(path)


class ModelCopy(WorkerPlugin):
    """Carries a model's file to every worker, those that come later included.

    Args:
        content: The file.
        digest: Its SHA-256, in hex.
    """

    def __init__(self, content: bytes, digest: str) -> None:
        self.content = content
        self.digest = digest
        self.name = f"playable-environments-model-{digest}"

    def setup(self, worker: Worker) -> None:
        """Put the file into the worker's folder."""
        keep_copy(self.content, self.digest, Path(worker.local_directory))
        self.content = b""

    def teardown(self, worker: Worker) -> None:
        """Take it away."""
        _copy_path(Path(worker.local_directory), self.digest).unlink(missing_ok=True)


def _copy_path(folder: Path, digest: str) -> Path:
    return folder / f"model-{digest}.safetensors"
