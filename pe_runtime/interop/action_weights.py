"""Action modules and discriminators of the authors' checkpoints: their entries, and ours from them.

    theirs                                        ours
    action_network.mlp_backbone.{0,3,6}           action_network.{first,second,third}
                               .{1,4,7}             folded into these
    action_network.{mean,log_variance,final}_fc   action_network.{mean,log_variance,logits}
    centroid_estimator.estimated_centroids        action_network.centroids
    dynamics_network.all_cells.N                  dynamics.cells.N
    dynamics_network.all_initial_hidden_states.N  dynamics.initial_hidden[N]
                    .all_initial_hidden_cell_...  dynamics.initial_cell[N]
    dynamics_network.mlp_backbone.0               dynamics.hidden
    dynamics_network.mlp_heads.{0,1,2,3}          dynamics.{turn,movement,style,pose}
    model.{0,2,4}, linear                         layers.{0,1,2}, score       (discriminators)

What our modules do not have is folded into the layers next to it: batch statistics, the axes of a
y-up world, positions in other units, and the sines and cosines of the two angles that are zero in
every state. Not used are R's predictions of those two angles (and of the third, where R turns
nothing) and of the height, which the authors overwrite.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import torch
from torch import Tensor

from pe_runtime.config import ActionConfig
from pe_runtime.config.checks import demand
from pe_runtime.config.objects import Triple
from pe_runtime.geometry.native_world import WORLD_FROM_NATIVE

EPSILON = 1e-5
"""Added to the standard deviation in the batch statistics."""

Shapes = dict[str, tuple[int, ...]]
A = "action_network"
R = "dynamics_network"
SHARED = (("hidden", "mlp_backbone.0"), ("style", "mlp_heads.2"), ("pose", "mlp_heads.3"))
"""Layers of R that are the same on both sides, ours and theirs."""


@dataclass(frozen=True)
class NativeActions:
    """What the authors' checkpoints of one world do not say of themselves.

    Attributes:
        up: Up axis of the world, "z" or "y".
        seen_scale: Metres that count as 1 where positions enter their A; axes of their world.
        rolled_scale: The same of their R.
    """

    up: str
    seen_scale: Triple
    rolled_scale: Triple

    @property
    def axis(self) -> int:
        """Index of the up axis, about which objects turn."""
        return {"y": 1, "z": 2}[self.up]


NATIVE_ACTIONS = MappingProxyType(
    {
        "tennis": NativeActions("z", (10.0, 20.0, 2.15), (1.0, 1.0, 1.0)),
        "minecraft": NativeActions("y", (10.0, 2.15, 10.0), (10.0, 2.15, 10.0)),
    }
)


def action_entries(config: ActionConfig, style_features: int, pose_features: int) -> Shapes:
    """Their names and shapes of one action module, below `object_animation_models.N.`.

    Args:
        config: Of the module, in our terms.
        style_features: Length of a style code.
        pose_features: Length of a pose code.
    """
    hidden, v, width = config.hidden, config.variability, config.dynamics_width
    found: Shapes = {f"{A}.mlp_backbone.0.weight": (hidden, 9)}
    found |= {f"{A}.mlp_backbone.{layer}.weight": (hidden, hidden) for layer in (3, 6)}
    found |= {f"{A}.mlp_backbone.{layer}.bias": (hidden,) for layer in (0, 3, 6)}
    statistics = ("gamma", "beta", "running_mean", "running_std")
    found |= {f"{A}.mlp_backbone.{i}.{name}": (hidden,) for i in (1, 4, 7) for name in statistics}
    found |= _linear_entries(f"{A}.mean_fc", v, hidden)
    found |= _linear_entries(f"{A}.log_variance_fc", v, hidden)
    found |= _linear_entries(f"{A}.final_fc", config.actions, v)
    found["centroid_estimator.estimated_centroids"] = (config.actions, v)
    seen = 9 + style_features + pose_features + config.actions + v
    for layer in range(config.dynamics_layers):
        cell = f"{R}.all_cells.{layer}"
        found[f"{cell}.weight_ih"] = (4 * width, width if layer else seen)
        found[f"{cell}.weight_hh"] = (4 * width, width)
        found |= {f"{cell}.{name}": (4 * width,) for name in ("bias_ih", "bias_hh")}
        found[f"{R}.all_initial_hidden_states.{layer}"] = (width,)
        found[f"{R}.all_initial_hidden_cell_states.{layer}"] = (width,)
    found |= _linear_entries(f"{R}.mlp_backbone.0", width, width)
    for head, size in enumerate((6, 3, style_features, pose_features)):
        found |= _linear_entries(f"{R}.mlp_heads.{head}", size, width)
    return found


def discriminator_entries(config: ActionConfig, pose_features: int) -> Shapes:
    """Their names and shapes of one discriminator, below `discriminator_models.N.`.

    Args:
        config: Of the discriminator, in our terms.
        pose_features: Length of a pose code.
    """
    width, kernel = config.discriminator_width, 5
    seen = 3 + pose_features + config.actions + config.variability
    shapes = {f"model.{i}": (width, width if i else seen, kernel) for i in (0, 2, 4)}
    found: Shapes = {}
    for layer, shape in (shapes | {"linear": (1, width)}).items():
        inputs = shape[1] * shape[2] if len(shape) == 3 else shape[1]
        found[f"{layer}.weight_orig"] = shape
        found[f"{layer}.weight_u"] = found[f"{layer}.bias"] = (shape[0],)
        found[f"{layer}.weight_v"] = (inputs,)
    return found


def convert_action_module(
    theirs: Mapping[str, Tensor], config: ActionConfig, native: NativeActions
) -> dict[str, Tensor]:
    """Weights of one `ActionModule` from theirs.

    Args:
        theirs: Entries as `action_entries` names them.
        config: Of our module.
        native: Of their world.

    Returns:
        Our names -> float32 tensors.

    Raises:
        ConfigError: The configuration is not of the authors' design.
    """
    design = config.design == "state" and config.predict_style and not config.bounded_positions
    turns = config.movement_frame == "object" and config.sees_heading
    demand(
        design and turns,
        'action: design "state", movement_frame "object", sees_heading and predict_style, without '
        "bounded_positions, for weights of the paper's authors",
    )
    own = {name: tensor.double() for name, tensor in theirs.items()}
    found = _action_network(own, config, native) | _dynamics(own, config, native)
    return {name: tensor.float().contiguous() for name, tensor in found.items()}


def convert_discriminator(theirs: Mapping[str, Tensor], native: NativeActions) -> dict[str, Tensor]:
    """Weights of one `TemporalDiscriminator` of "states" from theirs.

    Positions keep their unit, since another would change what spectral normalisation divides by:
    our `discriminator_scale` has to be theirs.

    Args:
        theirs: Entries as `discriminator_entries` names them.
        native: Of their world.

    Returns:
        Our names -> float32 tensors.
    """
    world_from_native = WORLD_FROM_NATIVE[native.up]
    found = {}
    pairs = {f"layers.{i}": f"model.{2 * i}" for i in range(3)} | {"score": "linear"}
    for ours, name in pairs.items():
        weight, u, v, bias = (
            theirs[f"{name}.{part}"].double()
            for part in ("weight_orig", "weight_u", "weight_v", "bias")
        )
        if ours == "layers.0":
            place = torch.einsum("wn,ank->awk", world_from_native, weight[:, :3])
            weight = torch.cat([place, weight[:, 3:]], dim=1)
            v = v.unflatten(0, weight.shape[1:])
            v = torch.cat([world_from_native @ v[:3], v[3:]]).flatten()
        found[f"{ours}.bias"] = bias
        found[f"{ours}.parametrizations.weight.original"] = weight
        found[f"{ours}.parametrizations.weight.0._u"] = u
        found[f"{ours}.parametrizations.weight.0._v"] = v
    return {name: tensor.float().contiguous() for name, tensor in found.items()}


def _linear_entries(name: str, outputs: int, inputs: int) -> Shapes:
    return {f"{name}.weight": (outputs, inputs), f"{name}.bias": (outputs,)}


def _action_network(
    own: Mapping[str, Tensor], config: ActionConfig, native: NativeActions
) -> dict[str, Tensor]:
    found = {"centroids": own["centroid_estimator.estimated_centroids"]}
    for name, layer in (("first", 0), ("second", 3), ("third", 6)):
        weight, bias = _linear(own, f"{A}.mlp_backbone.{layer}")
        if name == "first":
            place, shift = _place_columns(weight, native, native.seen_scale, config)
            weight, bias = place, bias + shift
        statistics = f"{A}.mlp_backbone.{layer + 1}"
        gain = own[f"{statistics}.gamma"] / (own[f"{statistics}.running_std"] + EPSILON)
        found[f"{name}.weight"] = gain[:, None] * weight
        centred = bias - own[f"{statistics}.running_mean"]
        found[f"{name}.bias"] = gain * centred + own[f"{statistics}.beta"]
    heads = (("mean", "mean_fc"), ("log_variance", "log_variance_fc"), ("logits", "final_fc"))
    for ours, theirs in heads:
        found[f"{ours}.weight"], found[f"{ours}.bias"] = _linear(own, f"{A}.{theirs}")
    return {f"action_network.{name}": tensor for name, tensor in found.items()}


def _dynamics(
    own: Mapping[str, Tensor], config: ActionConfig, native: NativeActions
) -> dict[str, Tensor]:
    found = {}
    for layer in range(config.dynamics_layers):
        for part in ("weight_ih", "weight_hh", "bias_ih", "bias_hh"):
            found[f"cells.{layer}.{part}"] = own[f"{R}.all_cells.{layer}.{part}"]
    weight = found["cells.0.weight_ih"]
    place, shift = _place_columns(weight, native, native.rolled_scale, config)
    found["cells.0.weight_ih"] = torch.cat([place, weight[:, 9:]], dim=1)
    found["cells.0.bias_ih"] = found["cells.0.bias_ih"] + shift
    states = (("hidden", "hidden_states"), ("cell", "hidden_cell_states"))
    for ours, theirs in states:
        layers = [own[f"{R}.all_initial_{theirs}.{i}"] for i in range(config.dynamics_layers)]
        found[f"initial_{ours}"] = torch.stack(layers)
    for ours, theirs in SHARED:
        found[f"{ours}.weight"], found[f"{ours}.bias"] = _linear(own, f"{R}.{theirs}")
    ground = WORLD_FROM_NATIVE[native.up][:2] / config.movement_scale
    weight, bias = _linear(own, f"{R}.mlp_heads.1")
    found["movement.weight"], found["movement.bias"] = ground @ weight, ground @ bias
    found["direct_movement.weight"] = torch.zeros(2, config.actions)
    if config.predict_heading:
        weight, bias = _linear(own, f"{R}.mlp_heads.0")
        about_up = slice(2 * native.axis, 2 * native.axis + 2)
        found["turn.weight"], found["turn.bias"] = weight[about_up], bias[about_up]
    return {f"dynamics.{name}": tensor for name, tensor in found.items()}


def _linear(own: Mapping[str, Tensor], name: str) -> tuple[Tensor, Tensor]:
    return own[f"{name}.weight"], own[f"{name}.bias"]


def _place_columns(
    weight: Tensor, native: NativeActions, scale: Triple, config: ActionConfig
) -> tuple[Tensor, Tensor]:
    """What a layer makes of position and heading, from what it made of theirs.

    Their first nine inputs are (sin a, cos a, sin b, cos b, sin c, cos c) and the position by
    `scale`; ours are the position by `position_scale` and (sin, cos) of the heading.

    Returns:
        Five columns, and what the cosines of the two zero angles add to the bias.
    """
    theirs, ours = (
        torch.tensor(each, dtype=weight.dtype) for each in (scale, config.position_scale)
    )
    native_from_world = WORLD_FROM_NATIVE[native.up].T
    position = (weight[:, 6:9] / theirs) @ native_from_world * ours
    heading = weight[:, 2 * native.axis : 2 * native.axis + 2]
    cosines = [2 * axis + 1 for axis in range(3) if axis != native.axis]
    return torch.cat([position, heading], dim=1), weight[:, cosines].sum(dim=1)
