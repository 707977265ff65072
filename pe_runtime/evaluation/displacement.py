"""How far a pose moves the body as a whole: what of a deformation is a mere shift."""

import math
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Float
from torch import Tensor

from pe_runtime.config import ModelConfig
from pe_runtime.field.object_field import ObjectField
from pe_runtime.networks import SynthesisNetworks
from pe_runtime.state import EnvironmentState, move

CELLS = (20, 20, 28)
"""Sample points along the volume's axes: 8 cm apart in a volume of a person's size."""


@runtime_checkable
class WithFields(Protocol):
    """A model whose fields can be asked."""

    config: ModelConfig
    networks: SynthesisNetworks


@torch.no_grad()
def mean_displacement(field: ObjectField, pose: Float[Tensor, " pose"]) -> Float[Tensor, "3"]:
    """Density-weighted mean of the bending, E[B(x, pi)] = sum sigma(x~) B(x, pi) / sum sigma(x~).

    With x~ = x + B(x, pi) over a regular grid of the object's volume. The body is seen shifted by
    the opposite: what is canonically at x~ appears at x~ - B.

    Args:
        field: The object's class.
        pose: Code pi.

    Returns:
        Metres along the object's axes; zero for a class that does not bend or an empty volume.
    """
    pose = pose.to(field.middle.device)
    if field.bending is None or field.density is None:
        return torch.zeros(3)
    steps = [(torch.arange(cells) + 0.5) / cells * 2 - 1 for cells in CELLS]
    points = torch.cartesian_prod(*steps).to(pose)[None]
    frame = torch.zeros(1, dtype=torch.long, device=pose.device)
    bent = field.bending(points, frame, pose[None])
    density = field.densities(field.trunk(points, frame, pose[None]))[..., None]
    total = density.sum().clamp(min=1e-12)
    return (((bent - points) * density).sum(dim=(0, 1)) / total * field.extent).cpu()


def put_back(
    environment: object, state: EnvironmentState, before: EnvironmentState, name: str
) -> EnvironmentState:
    """Move a reposed object so that its body's mean is where the pose before had it.

    The position changes by E[B(x, pi')] - E[B(x, pi)], so a pose that only shifts the body is
    undone exactly and what remains between the pictures is articulation.

    Args:
        environment: The model; one without fields of its own is left as it is.
        state: With the other pose.
        before: With the own pose.
        name: The object.
    """
    if not isinstance(environment, WithFields):
        return state
    objects = environment.config.objects
    field = environment.networks.fields[next(o.class_name for o in objects if o.name == name)]
    shift = mean_displacement(field, state[name].pose) - mean_displacement(field, before[name].pose)
    shift = turned(shift, state[name].heading)
    return move(state, name, state[name].position + shift.to(state[name].position))


def turned(vector: Float[Tensor, "3"], heading: float) -> Float[Tensor, "3"]:
    """A vector of the object's axes along the world's."""
    sine, cosine = math.sin(heading), math.cos(heading)
    x, y, z = vector.tolist()
    return torch.tensor([cosine * x - sine * y, sine * x + cosine * y, z])
