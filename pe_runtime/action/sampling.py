"""How a training reconstruction is drawn: noise, and the actions drawn with it."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor


class Noise:
    """All noise of a reconstruction.

    A subclass that hands out recorded numbers repeats a recorded reconstruction.

    Args:
        generator: Source of all numbers (a generator of the CPU).
    """

    def __init__(self, generator: torch.Generator) -> None:
        self.generator = generator

    def uniform(self, *shape: int) -> Tensor:
        """Numbers in [0, 1), on the CPU."""
        return torch.rand(shape, generator=self.generator)

    def normal(self, like: Tensor) -> Tensor:
        """Standard normal numbers with the shape, type and device of `like`."""
        return torch.randn(like.shape, generator=self.generator).to(like)

    def exponential(self, like: Tensor) -> Tensor:
        """Numbers of the exponential distribution of mean 1; neither 0 nor infinite."""
        # In bfloat16 many a number below 1 would round to 1.
        wide = torch.promote_types(like.dtype, torch.float32)
        uniform = torch.rand(like.shape, generator=self.generator).to(like.device, wide)
        # The logarithm of 0 and of 1 would be infinite in the Gumbel noise made of this.
        return -torch.log(uniform.clamp(torch.finfo(wide).tiny, 1.0 - 1e-7)).to(like)


@dataclass(frozen=True)
class Sampling:
    """How a training reconstruction is drawn.

    Attributes:
        temperature: Of the Gumbel-softmax; lower is closer to the true gradient and noisier.
        teacher_forcing: Probability that R steps from the encoded state instead of its own.
        variability: Probability that a sequence is rebuilt with its v; with v = 0 otherwise.
        noise: Where all noise comes from.
        soft: Actions are the Gumbel-softmax itself, a mixture, instead of its largest entry.
        given: So many states from the first on are always stepped from as encoded.
        centroid_rate: How fast the centroids of a "state" A follow the batch; 0: not at all.
    """

    temperature: float
    teacher_forcing: float
    variability: float
    noise: Noise
    soft: bool = False
    given: int = 1
    centroid_rate: float = 0.0


def sample_actions(
    logits: Float[Tensor, "*batch actions"], sampling: Sampling
) -> Float[Tensor, "*batch actions"]:
    """Draw one action per row by the Gumbel-softmax, softmax((logits + g) / temperature).

    Unless `soft`, the result is one-hot and only its gradient is that of the softmax
    (straight-through estimator).

    Args:
        logits: Unnormalised log-probabilities.
        sampling: Temperature, softness and noise.
    """
    gumbel = -torch.log(sampling.noise.exponential(logits))
    soft = torch.softmax((logits + gumbel) / sampling.temperature, dim=-1)
    if sampling.soft:
        return soft
    hard = torch.zeros_like(soft).scatter(-1, soft.argmax(dim=-1, keepdim=True), 1.0)
    return hard + soft - soft.detach()
