"""Actions that training found no use for leave a module before anyone is offered them."""

from collections.abc import Sequence
from dataclasses import replace

import torch
from torch import Tensor

from pe_runtime.action.module import ActionModule

ROWS = (
    "action_network.logits.weight",
    "action_network.logits.bias",
    "action_network.direct.weight",
    "action_network.centroids",
)
"""Tensors with a row per action."""
COLUMNS = ("dynamics.direct_movement.weight",)
"""Tensors with a column per action."""
INPUT = "dynamics.cells.0.weight_ih"
"""R's first layer, which reads (position, what is seen, action, variability) in this order."""


def with_actions(module: ActionModule, kept: Sequence[int], codes: tuple[int, int]) -> ActionModule:
    """The module without all but some of its actions, which does the very same with those.

    Args:
        module: A and R.
        kept: Indices of the actions that stay, in their new order.
        codes: Lengths of style and pose codes.
    """
    index, config = torch.tensor(kept), module.config
    smaller = ActionModule(replace(config, actions=len(kept)), *codes)
    tensors = {name: _part(name, each, index, module) for name, each in module.state_dict().items()}
    smaller.load_state_dict(tensors)
    return smaller.to(next(module.parameters()).device).train(module.training)


def _part(name: str, tensor: Tensor, kept: Tensor, module: ActionModule) -> Tensor:
    kept = kept.to(tensor.device)
    if name in ROWS:
        return tensor[kept]
    if name in COLUMNS:
        return tensor[:, kept]
    if name == INPUT:
        end = tensor.shape[1] - module.config.variability
        first = end - module.config.actions
        return torch.cat([tensor[:, :first], tensor[:, first + kept], tensor[:, end:]], dim=1)
    return tensor
