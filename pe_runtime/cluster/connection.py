"""A place to draw: workers on this machine, started for one job, or a Dask cluster that runs."""

import logging
import re
import signal
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker

from pe_runtime.contract.errors import ClusterError

try:
    import dask
    from dask.system import CPU_COUNT
    from distributed import Client, LocalCluster, Security
    from distributed.system import MEMORY_LIMIT
    from distributed.utils import silence_logging_cmgr
except ModuleNotFoundError as error:
    raise ClusterError(
        "drawing on a cluster needs Dask; install it with: "
        "pip install 'playable-environments[cluster]'"
    ) from error

LOCAL = "local"
ADDRESS = re.compile(r"(?:(tcp|tls|ws|wss)://)?[\w.\-\[\]:]*[\w\]]:\d+")
CONNECT_SECONDS = 20
BYTES_PER_WORKER = 1 << 30
"""Memory of this machine for each worker that is started unasked: torch, a model, one frame."""
CLOSED_DOORS = {
    # Status pages of the scheduler and of every worker, open to everybody on this machine.
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
}


@dataclass(frozen=True)
class Place:
    """Where frames are drawn.

    Attributes:
        address: Of a Dask scheduler; None for workers on this machine.
        workers: How many to start here; None for as many as it can use.
    """

    address: str | None = None
    workers: int | None = None


@dataclass(frozen=True)
class Connection:
    """A cluster that can be sent work.

    Attributes:
        client: The way to it.
        threads: Threads with which each worker draws; None where Dask's own setting decides.
    """

    client: Client
    threads: int | None

    @property
    def workers(self) -> int:
        """Workers that are there now."""
        return len(self.client.nthreads())


def parse_place(text: str) -> Place:
    """Read `local`, `local:4`, `tcp://10.0.0.5:8786`, `tls://farm:8786` or `farm:8786`.

    Raises:
        ClusterError: It is none of these.
    """
    name, colon, count = text.partition(":")
    if name == LOCAL and (not colon or (count.isdecimal() and int(count) > 0)):
        return Place(workers=int(count) if colon else None)
    if name == LOCAL or not ADDRESS.fullmatch(text):
        raise ClusterError(
            f"cluster: expected local, local:4 (workers) or the address of a Dask scheduler, such "
            f"as tcp://10.0.0.5:8786; found {text!r}"
        )
    return Place(address=text)


@contextmanager
def connect(place: Place, frames: int, gpu: bool) -> Iterator[Connection]:
    """Reach a cluster, or start one that ends with the block.

    Args:
        place: Which.
        frames: How many there are to draw; no more workers are started.
        gpu: Whether one GPU draws for all; then one worker is enough.

    Raises:
        ClusterError: There is no scheduler at the address.
    """
    # What goes wrong is told once, by whoever draws.
    with silence_logging_cmgr(logging.CRITICAL), _connect(place, frames, gpu) as connection:
        yield connection


@contextmanager
def _connect(place: Place, frames: int, gpu: bool) -> Iterator[Connection]:
    if place.address is not None:
        with _client(place.address, None) as client:
            yield Connection(client, None)
        return
    own = min(CPU_COUNT, max(1, MEMORY_LIMIT // BYTES_PER_WORKER))
    count = min(place.workers or (1 if gpu else own), frames)
    with _local_cluster(count) as cluster, _client(cluster, cluster.security) as client:
        yield Connection(client, max(1, CPU_COUNT // count))


@contextmanager
def _client(cluster: str | LocalCluster, security: Security | None) -> Iterator[Client]:
    try:
        client = Client(cluster, security=security, timeout=CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise ClusterError(
            f"no Dask scheduler answers at {cluster} ({error}); start one with `dask scheduler` "
            "and workers with `dask worker ADDRESS`, or use --cluster local"
        ) from error
    with closing(client):
        yield client


@contextmanager
def _local_cluster(workers: int) -> Iterator[LocalCluster]:
    """Worker processes that only holders of a key made for this job can talk to."""
    with dask.config.set(CLOSED_DOORS), _interrupts_for_us_alone():
        cluster = LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            host="127.0.0.1",
            security=True,
            # A worker that is ended because memory is short would only be ended again.
            memory_limit=None,
            dashboard_address=None,
            scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
            silence_logs=logging.CRITICAL,
        )
    with cluster:
        yield cluster


@contextmanager
def _interrupts_for_us_alone() -> Iterator[None]:
    """Processes started from here on, now or later by Dask's threads, do not see Ctrl-C."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # Its start would unblock what is blocked here.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
