"""The one function that Dask sees. Its imports wait until it runs, in a worker."""

from typing import Any


def draw_run(parcel: bytes) -> dict[str, Any]:
    """Draw a run of frames in this worker; see `drawing.draw`."""
    from distributed import get_worker

    from pe_runtime.cluster.drawing import Workplace, draw
    from pe_runtime.cluster.parcels import answer_as_dict

    worker = get_worker()
    place = Workplace(worker.address, worker.local_directory, worker.state.nthreads)
    return answer_as_dict(draw(parcel, place))
