"""Batch normalisation over the batch of all processes, not of each for itself."""

import torch
from torch import Tensor, nn
from torch.nn.modules.batchnorm import _BatchNorm

from pe_runtime.training.processes import Total


class GlobalBatchNorm(_BatchNorm):
    """A batch normalisation whose statistics are those of all processes' batches together.

    Parameters, running statistics and their names are those of the layer that it replaces.

    Args:
        layer: The layer that it stands for.
    """

    def __init__(self, layer: _BatchNorm) -> None:
        super().__init__(layer.num_features, layer.eps, layer.momentum, affine=False)
        self.affine = layer.affine
        self.weight, self.bias = layer.weight, layer.bias
        for name, buffer in layer.named_buffers():
            self.register_buffer(name, buffer)
        self.train(layer.training)

    def forward(self, values: Tensor) -> Tensor:
        """Normalise (batch, channels, ...) by mean and variance over all but the channels."""
        if not self.training:
            return super().forward(values)
        exact = values.float()
        over = [d for d in range(exact.ndim) if d != 1]
        shape = [1, -1] + [1] * (exact.ndim - 2)
        own = exact.new_full((1,), exact.numel() / exact.shape[1])
        *sums, count = Total.apply(torch.cat([exact.sum(over), own])).split(
            [len(self.running_mean), 1]
        )
        mean = sums[0] / count
        away = exact - mean.view(shape)
        variance = Total.apply(away.square().sum(over)) / count
        self._remember(mean.detach(), variance.detach() * (count / (count - 1).clamp(min=1)))
        normal = away * (variance + self.eps).rsqrt().view(shape)
        if self.affine:
            normal = normal * self.weight.view(shape) + self.bias.view(shape)
        return normal.to(values.dtype)

    @torch.no_grad()
    def _remember(self, mean: Tensor, variance: Tensor) -> None:
        self.num_batches_tracked += 1
        share = self.momentum if self.momentum is not None else 1 / float(self.num_batches_tracked)
        self.running_mean.lerp_(mean, share)
        self.running_var.lerp_(variance, share)

    def _check_input_dim(self, values: Tensor) -> None:
        """Any number of dimensions is as good as another."""


def share_statistics(module: nn.Module) -> None:
    """Let every batch normalisation in a module see the batches of all processes."""
    for name, child in module.named_children():
        if isinstance(child, _BatchNorm):
            setattr(module, name, GlobalBatchNorm(child))
        else:
            share_statistics(child)
