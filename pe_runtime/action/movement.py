"""Movement on the ground as the camera sees it: right and forward, in metres.

The dynamics network says "0.3 m to the right" and not "0.3 m along +x", so that an action keeps its
meaning when the camera turns (paper, Sec. 3.2). Its M is the camera's yaw here: tilt and roll are
left out because objects stay on the ground. The models of the paper's authors speak of the right
and forward of the object itself, which are world x and y at heading 0.

        world, from above            camera looks along z, x points right
            y                             forward = (z_x, z_y) / |.|
            |___ x                        right   = forward turned by -90 degrees
"""

import torch
from jaxtyping import Float
from torch import Tensor

from pe_runtime.contract.errors import ConfigError

SHORTEST_FORWARD = 1e-3
"""Below this length (0.06 degrees off the vertical) the view direction has no usable yaw."""


def ground_axes(
    world_from_camera: Float[Tensor, "*batch 3 3"],
    frame: str = "camera",
    headings: Float[Tensor, "*batch"] | None = None,
) -> Float[Tensor, "*batch 2 2"]:
    """Ground directions that "right" and "forward" mean, as columns (the paper's M).

    A camera that looks straight down has no forward on the ground; the direction of its upper
    picture edge is taken then, which is the limit of the forward of a camera tilting downwards. For
    one that looks straight up it is the lower edge, and for one whose up is vertical too (a broken
    matrix) it is world y. Roll is ignored: right is always 90 degrees clockwise of forward.

    Args:
        world_from_camera: Rotations, camera axes as OpenCV has them (x right, y down, z forward).
        frame: "camera", "object" for movements along the object's own axes, or "world" for those
            along world x and y.
        headings: Radians about world z; None where objects keep the world's axes.

    Raises:
        ConfigError: Another frame is asked for.
    """
    if frame == "object" and headings is not None:
        return _turned(headings)
    if frame in ("world", "object"):
        batch = world_from_camera.shape[:-2]
        return torch.eye(2).to(world_from_camera).expand(*batch, 2, 2)
    if frame != "camera":
        raise ConfigError(f"movement_frame must be 'camera', 'object' or 'world', found {frame!r}")
    view, down = world_from_camera[..., 2], world_from_camera[..., 1]
    upper_edge = torch.where(view[..., 2:] > 0, down[..., :2], -down[..., :2])
    world_y = torch.tensor([0.0, 1.0]).to(view).expand_as(upper_edge)
    forward = _first_long_enough(view[..., :2], _first_long_enough(upper_edge, world_y))
    forward = forward / torch.linalg.vector_norm(forward, dim=-1, keepdim=True)
    right = torch.stack([forward[..., 1], -forward[..., 0]], dim=-1)
    return torch.stack([right, forward], dim=-1)


def movements(
    positions: Float[Tensor, "*batch time 3"], axes: Float[Tensor, "*batch time 2 2"]
) -> Float[Tensor, "*batch moves 2"]:
    """Movement from each state to the next, (right, forward) metres in the first one's frame.

    Args:
        positions: Metres, world.
        axes: From `ground_axes`, one per state; the last is not used.

    Returns:
        One movement fewer than there are states (none for none).
    """
    steps = positions[..., 1:, :2] - positions[..., :-1, :2]
    axes = axes[..., : steps.shape[-2], :, :]
    return torch.einsum("...wm,...w->...m", axes, steps)


def moved(
    position: Float[Tensor, "*batch 3"],
    movement: Float[Tensor, "*batch 2"],
    axes: Float[Tensor, "*batch 2 2"],
) -> Float[Tensor, "*batch 3"]:
    """Position after a movement, x + M Delta; the height stays what it was."""
    step = torch.einsum("...wm,...m->...w", axes, movement)
    return torch.cat([position[..., :2] + step, position[..., 2:]], dim=-1)


def _turned(headings: Tensor) -> Tensor:
    """Ground axes of objects with the given headings."""
    sine, cosine = headings.sin(), headings.cos()
    right, forward = torch.stack([cosine, sine], dim=-1), torch.stack([-sine, cosine], dim=-1)
    return torch.stack([right, forward], dim=-1)


def _first_long_enough(wanted: Tensor, otherwise: Tensor) -> Tensor:
    length = torch.linalg.vector_norm(wanted, dim=-1, keepdim=True)
    return torch.where(length > SHORTEST_FORWARD, wanted, otherwise)
