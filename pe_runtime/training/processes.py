"""Several processes that train one model: each takes its part of every batch (`torchrun`).

All of them draw the same random batch and cut their part out of it; gradients are averaged before
they are clipped. So two processes make the steps that one would make with the doubled batch.
"""

import contextlib
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import torch
from torch import Tensor, distributed, nn

from pe_runtime.contract.errors import ConfigError

if distributed.is_available():
    # Its functions take the group that there is when they are defined for their default, and
    # optimisers load it sooner or later. Loaded after the group was made, it keeps gloo's threads
    # alive to the very end, where one of them may abort an interpreter that is closing.
    import torch.distributed.nn

Log = dict[str, float]


@dataclass(frozen=True)
class Team:
    """The processes of a training; one alone where nobody started more.

    Attributes:
        rank: Number of this process.
        size: How many there are.
        device: Where tensors lie that processes exchange.
    """

    rank: int = 0
    size: int = 1
    device: str = "cpu"

    @classmethod
    def current(cls) -> "Team":
        """The team that this process has joined."""
        if not (distributed.is_available() and distributed.is_initialized()):
            return cls()
        device = "cuda" if distributed.get_backend() == "nccl" else "cpu"
        return cls(distributed.get_rank(), distributed.get_world_size(), device)

    @property
    def leads(self) -> bool:
        """Whether this is the process that writes, measures and speaks."""
        return self.rank == 0

    def part(self, whole: int) -> slice:
        """Which of so many entries of a batch are this process's own.

        Args:
            whole: Entries of the batch of all processes; a multiple of their number.
        """
        own = whole // self.size
        return slice(self.rank * own, (self.rank + 1) * own)

    def largest(self, *values: float) -> list[float]:
        """The largest of what the processes say, for each of the values."""
        if self.size == 1:
            return list(values)
        shared = torch.tensor(values, dtype=torch.float64, device=self.device)
        distributed.all_reduce(shared, distributed.ReduceOp.MAX)
        return shared.tolist()

    def means(self, figures: Log) -> Log:
        """Figures averaged over the processes."""
        if self.size == 1:
            return figures
        shared = torch.tensor(list(figures.values()), dtype=torch.float64, device=self.device)
        distributed.all_reduce(shared)
        return dict(zip(figures, (shared / self.size).tolist(), strict=True))

    def average_gradients(self, parameters: Iterable[nn.Parameter]) -> None:
        """Replace every gradient by its mean over the processes, in one exchange.

        A parameter that no process has reached keeps none, so that an optimiser passes over it as
        it would in a single process.
        """
        if self.size == 1:
            return
        every = list(parameters)
        flat = [(torch.zeros_like(p) if p.grad is None else p.grad).flatten() for p in every]
        reached = torch.tensor([float(p.grad is not None) for p in every], device=flat[0].device)
        shared = torch.cat([*flat, reached])
        distributed.all_reduce(shared)
        *pieces, reached = shared.split([*(p.numel() for p in every), len(every)])
        for parameter, piece, count in zip(every, pieces, reached.tolist(), strict=True):
            if count:
                parameter.grad = piece.view_as(parameter) / self.size

    def spread(self, module: nn.Module) -> None:
        """Give every process the weights and statistics of the first."""
        if self.size > 1:
            for tensor in module.state_dict().values():
                distributed.broadcast(tensor, 0)

    def wait(self) -> None:
        """Wait until all processes are here."""
        self.largest(0.0)


class Total(torch.autograd.Function):
    """The sum of a tensor over all processes, through which gradients flow back to each of them."""

    @staticmethod
    def forward(context: object, own: Tensor) -> Tensor:
        """Sum over the processes."""
        shared = own.clone()
        distributed.all_reduce(shared)
        return shared

    @staticmethod
    def backward(context: object, gradient: Tensor) -> Tensor:
        """What a process adds reaches the loss of every process."""
        shared = gradient.contiguous().clone()
        distributed.all_reduce(shared)
        return shared


@contextlib.contextmanager
def joined(device: str = "auto") -> Iterator[Team]:
    """Join the processes that `torchrun` has started, if it has, for as long as the block lasts.

    NCCL connects them where they train by CUDA (one GPU for each), gloo elsewhere.

    Args:
        device: "cpu", "cuda", or "auto" for GPUs where there are some.

    Raises:
        ConfigError: There are more processes than GPUs.
    """
    if int(os.environ.get("WORLD_SIZE", "1")) == 1 or not distributed.is_available():
        yield Team()
        return
    backend = "gloo"
    if device != "cpu" and torch.cuda.is_available():
        backend, own = "nccl", int(os.environ.get("LOCAL_RANK", "0"))
        if own >= torch.cuda.device_count():
            raise ConfigError(
                f"expected one GPU for each process, found {torch.cuda.device_count()} for "
                "more; start fewer with --nproc-per-node"
            )
        torch.cuda.set_device(own)
    distributed.init_process_group(backend)
    try:
        yield Team.current()
    finally:
        distributed.destroy_process_group()
